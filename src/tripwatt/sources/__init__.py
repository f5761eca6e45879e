"""One small file per data set: raw columns in, canonical trips out."""
