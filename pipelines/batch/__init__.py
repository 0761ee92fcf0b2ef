"""Hundreds of photographs: which ones, where each result goes, who fits them, what is told of them all.

inputs, manifest -> Photograph -> plan (Item: place, settings) -> Job -> run (an executor's workers do `one.fit_one`)
-> journal -> rows -> materials (pooled) -> tables and page.
"""
