"""Bodies that move and bend freely: their mass matrices and forces, in coordinates that join to chains."""
