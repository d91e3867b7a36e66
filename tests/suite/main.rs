//! Promises about the processes of REPLICA, a module for each topic. `docs/promises.md` lists every promise with its test.
//!
//! The programs must be built: `cargo build --release --workspace`, then `cargo test --release -p replica-tests`. Many
//! tests wait most of their time, so more threads than cores shorten the run: `-- --test-threads 6`.

mod added_column;
mod batch;
mod changed_files;
mod column_pages;
mod crash_recovery;
mod damaged_states;
mod documentation;
mod isolation;
mod labeled_clouds;
mod launch_file;
mod live_mode;
mod live_rig;
mod live_sensor;
mod misbehaving_stages;
mod object_store;
mod observers;
mod output_folder;
mod pipeline;
mod power_loss;
mod recorder;
mod recordings;
mod report;
mod resources;
mod schedulers;
mod several_of_a_kind;
mod slurm;
mod stage_alone;
mod supervision;
mod swap;
mod swap_segmenter;
mod terminal;
mod two_lidars;
mod two_machines;
mod view;
mod zero_copy;
