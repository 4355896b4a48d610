//! Files that other tools open: path files, MCAP logs, pictures.
