"""What wear in A, B and C, one by one and together, does to the foundation and to the joints."""
