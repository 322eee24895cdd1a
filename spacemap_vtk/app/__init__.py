"""The window: ``spacemap gui``. Every module here but `requirements` imports Qt.

Invariants that the parts rely on:

- Two scenes exist. The document's is never run: it checks what the user asks for. The engine's
  belongs to its thread, which alone configures and runs it. What is drawn is a `Frame`, a copy.
- VTK renders in the interface thread only.
- Nothing lists parameters: fields are made from ``sections()`` and each class's ``parameters``.
- Signals that cross threads end in bound methods of QObjects: Qt would call a plain function in
  the sender's thread.
"""
