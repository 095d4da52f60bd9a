"""Ground-truth fields, and the files of people that hold fields and samples.

Importing the package imports no module of it: what reads NetCDF in a process of its own must not wait for JAX.
"""
