"""Pages, their figures and words: plain records go to templates, numbers to people by one rule."""
