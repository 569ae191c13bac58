"""Examples that only look like the paper's, for the tests of what `carom reproduce` does with them."""
