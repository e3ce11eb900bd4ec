"""Laws and parts that the models share: free functions of arrays and scalars, no state."""
