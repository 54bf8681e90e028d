"""The HTTP interface: FastAPI over the stores and the queue."""
