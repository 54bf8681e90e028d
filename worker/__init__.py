"""The worker: takes job ids from Celery, supervises runners that compute, and tells the records what happened."""
