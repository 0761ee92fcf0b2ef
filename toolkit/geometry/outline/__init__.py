from .find import Found, find_sphere

__all__ = ["Found", "find_sphere"]
