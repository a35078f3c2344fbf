//! Combinations of solids.
