"""Who is measured: one file each, named like the library, each only ever run in a process of its own."""
