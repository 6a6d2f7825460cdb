"""Scenes: a camera, what it sees, lights, fog and a background, lowered to a graph of operations.

`description` says what a scene is, `predicates` which of its effects can be seen at all, `lowering` makes the graph.
"""
