"""For `pvbatch` under MPI: scripts one after another, as processes take longer to start than these.

mpirun -np 3 pvbatch tests/mpi/session.py SCRIPT,ARGUMENT,… …

Before each its name goes to the standard error.
"""

import os
import runpy
import sys

for words in sys.argv[1:]:
    script, *arguments = words.split(",")
    os.write(2, f"{os.path.basename(script)}\n".encode())
    sys.argv = [script, *arguments]
    runpy.run_path(script)
