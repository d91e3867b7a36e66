//! Programs that measure or picture one library, stage or run: one example for each study.
