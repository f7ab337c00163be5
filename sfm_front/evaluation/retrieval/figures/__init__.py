"""The figures of the paper, drawn anew from any dataset."""
