//! The command line of shadowfit.

fn main() {}
