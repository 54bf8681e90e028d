"""The addresses of the service: parse, call, translate."""
