"""The seed papers' numbers: what each paper states, what its equations give here, what was measured, and the
verdict.
"""
