"""The rows of the table of goals: each module measures some of them by `rows(rounds, say)`."""
