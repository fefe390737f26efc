"""The first contact of two bodies, with a certificate that there is none before."""
