//! Studies: programs that measure or picture one library, stage or run. Each is an example of this crate:
//! `cargo run --release -p studies --example NAME -- ARGUMENTS`; the first lines of its file describe its output.
//!
//! | studies | subject |
//! |---|---|
//! | `bench_*`, `*_bench`, `operators`, `throughput`, `live_load` | time and memory of kernels, networks, readers, the link |
//! | `odometry`, `sweeps_of_drive`, `place_drives`, `place_recorded_drive`, `place_slam_path` | odometry next to other programs; placement of drives |
//! | `color_truth`, `color_seams`, `offset_of_run` | colors, spectra and offsets of a run against its simulated town |
//! | `scene_errors`, `terrain_errors`, `survey_errors` | scenes, terrain and surveys of simulated drives against their exact towns |
//! | `town_scores`, `street_boxes` | instances, and the effect of each setting; vehicles and people of real streets with boxes |
//! | `compare_sweeps`, `gnss_error`, `town_map`, `camera_pictures`, `catalogue`, `material_spectra` | the simulator next to reality; its pictures |
//! | `campaign` | costs of finished runs; a campaign of many drives on a cluster with failures |
//! | `write_ground_model` | writes `models/ground.safetensors` |
//!
//! No program and no test may depend on a study. Code that a program needs belongs in a library; a property that must hold
//! belongs in a test. Examples of *use* are not studies: they are documentation of a library, or in `examples/`.
//!
//! Start reading at the page in `lab/notebook/` that shows the figures, which names the command; the tables of
//! `lab/peers/README.md` do so for comparisons with other programs. The library has what several studies share: [`recorded`]
//! messages of a run, a [`sweep_folder`] for other odometry programs, [`color_difference`], the [`exact_town`] of a simulated drive.

pub mod color_difference;
pub mod exact_town;
pub mod recorded;
pub mod sweep_folder;
