"""Parameters: definitions and values, the microservice, text file, packed file, metadata."""
