"""Parameters: what they are, the microservice, their file, their packed file, their metadata."""
