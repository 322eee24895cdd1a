"""The window: ``spacemap gui``. Every module here except `requirements` may import Qt.

Invariants:

- There are two scenes. The document's scene only checks the user's input and never runs. The
  engine's scene belongs to the engine's thread; no other thread configures or runs it. The view
  draws a `Frame`, which is a copy.
- VTK renders only in the interface thread.
- No list of parameters is written by hand: ``sections()`` and each class's ``parameters`` define
  the fields.
- A signal that crosses threads is connected to a bound method of a QObject. Qt would call a plain
  function in the sender's thread.
"""
