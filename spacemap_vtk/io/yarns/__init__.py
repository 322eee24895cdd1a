"""Read and write yarns as curves: .bcc, .tg3, .yarns, tables and VTK's lines."""
