"""Noise: bases on one lattice machinery, summed in octaves, and those that are sums of impulses or of waves."""
