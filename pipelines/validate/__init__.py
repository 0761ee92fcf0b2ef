"""Validation on renders of known truth: a designed set through the very pipeline that users run, and what came out.

design (what is rendered) -> shot (the photograph, whole or with an assumption broken) -> trial (rendered, fitted,
compared) -> run (all of them, side by side, resumable) -> score (coverage, ranks, efficiency, verdict) -> page.
"""
