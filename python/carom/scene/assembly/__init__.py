"""From the tree of tables to the arrays that the core takes."""
