"""Many runs at once: batches, sweeps, comparisons of methods, convergence in the step."""
