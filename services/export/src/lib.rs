//! export: joins the columns of each submap and writes files.
//!
//! | file | content |
//! |---|---|
//! | `clouds/submap_0003.ply` | all points of submap 3 with their columns, world frame (local east-north-up, m) |
//! | `clouds/submap_0003_spectra.ply` | the points that a mosaic camera saw, one float per band |
//! | `clouds/index.json` | per cloud: file, points, stamps, bounds, pose, classes, instances |
//! | `trajectory.txt` | `world_from_body` at both ends of every sweep, TUM format (by setting also `trajectory_kitti.txt`, `trajectory.csv`) |
//! | `georeference.json` | what the world frame is: its origin on the Earth, UTM zone, what placed the submaps |
//!
//! A cloud is written as soon as the last of its expected columns is there; which are expected is fixed before the start
//! (`Context::connected`), so a file never depends on timing. Whatever is in the state is on the disk: clouds are synced
//! before a state lists them, and after a restart clouds that are not listed are removed and written again.
//!
//! Until the end, clouds are in the frame of the odometry. Topic `placement` then says where each submap lies
//! (`docs/georeference.md`): clouds and trajectory are moved there, and the last clouds are written there at once.

mod cloud;
mod columns;
mod coordinates;
mod folder;
mod index;
mod join;
mod place;
mod spectra;
mod sweeps;
mod to_disk;
mod trajectory;
mod world;

pub use index::{CloudEntry, Index, SpectraEntry};

use folder::Folder;
use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory, tum_from_trajectory};
use geometry::Stamp;
use join::{Join, Joined, SavedJoin};
use messages::{Class, Color, Instance, Message, Placement, Spectra, StampedPose, Submap, Trajectory};
use place::Place;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use stage::{
    Bytes, Context, Flow, Inputs, Mode, Outputs, Port, Problem, Received, Stage, StateBytes, StepError, decode_head,
};
use std::path::PathBuf;
use world::World;

/// Raised when [`State`] changes.
const STATE_VERSION: u32 = 3;
/// Clouds that are moved between two signs of progress.
const CLOUDS_AT_A_TIME: usize = 4;

stage::settings! {
    /// Settings of export.
    pub struct Settings {
        /// What to write of each submap.
        pub formats: Vec<String> = vec!["ply".to_owned()] => stage::each_one_of(&["ply"]);
        /// Frame of the clouds: world (local, east-north-up where there is GNSS, corrected at the end of the drive), odom (as
        /// the odometry saw it, never moved), utm (easting and northing on the map; needs coordinates = "double").
        pub frame: String = "world".to_owned() => stage::one_of(&["world", "odom", "utm"]);
        /// Type of the coordinates in a cloud: float keeps 1 mm up to 8 km from the origin.
        pub coordinates: String = "float".to_owned() => stage::one_of(&["float", "double"]);
        /// Whether spectra get a cloud of their own.
        pub spectra: bool = true => stage::any();
        /// How to write the trajectory.
        pub trajectory: Vec<String> = vec!["tum".to_owned()] => stage::each_one_of(&["tum", "kitti", "csv"]);
    }
}

/// The sink of the pipeline.
pub struct Export {
    settings: Settings,
    folder: Folder,
    /// Inputs without a producer.
    absent: Vec<&'static str>,
    join: Join,
    clouds: Vec<CloudEntry>,
    /// Of `clouds`, the first so many are known to be on the disk.
    n_synced: usize,
    trajectory: geometry::Trajectory,
    /// Where the submaps lie, once it is known.
    placement: Option<Received<Placement>>,
    /// Whether the folder holds what is in `clouds` and nothing else of ours.
    is_folder_clean: bool,
}

/// All but the messages that wait, which follow it.
#[derive(Serialize, Deserialize)]
struct State {
    clouds: Vec<CloudEntry>,
    join: SavedJoin,
    /// Rows of the trajectory.
    poses: Vec<(i64, [f64; 3], [f64; 4])>,
    placement: Option<Bytes>,
}

impl Stage for Export {
    const NAME: &'static str = "export";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![
            Port::of::<Submap>(),
            Port::of::<Trajectory>(),
            Port::optional::<Placement>(),
            Port::optional::<Color>(),
            Port::optional::<Spectra>(),
            Port::optional::<Class>(),
            Port::optional::<Instance>(),
        ]
    }

    fn outputs() -> Vec<Port> {
        Vec::new()
    }

    fn check(settings: &Settings, _: &Context) -> Vec<Problem> {
        // Northings of millions of metres leave half a metre to a float.
        let is_coarse = settings.frame == "utm" && settings.coordinates != "double";
        let text = "must not be \"utm\" unless coordinates is \"double\": floats keep half a metre there";
        is_coarse.then(|| Problem::of_key("frame", text)).into_iter().collect()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let is_connected = |topic: &str| context.connected.iter().any(|connected| connected == topic);
        let is_wanted = |topic: &str| topic != Spectra::TOPIC || settings.spectra;
        let ports = Self::inputs();
        Ok(Self {
            settings: settings.clone(),
            folder: Folder::new(&context.output),
            absent: ports.iter().map(Port::topic).filter(|topic| !is_connected(topic)).collect(),
            join: Join::new(|topic| is_connected(topic) && is_wanted(topic), context.mode == Mode::Live),
            clouds: Vec::new(),
            n_synced: 0,
            trajectory: geometry::Trajectory::default(),
            placement: None,
            is_folder_clean: false,
        })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.prepare(outputs)?;
        for message in inputs.take::<Trajectory>() {
            message.rows().iter().try_for_each(|row| self.push_pose(row))?;
        }
        if let Some(last) = inputs.take::<Placement>().into_iter().next_back() {
            self.placement = Some(last).filter(|_| self.settings.frame != "odom");
        }
        self.join.take(inputs)?;
        self.write_complete(false, outputs)?;
        self.join.check_bounds()?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.prepare(outputs)?;
        self.write_complete(true, outputs)?;
        let world = self.world()?;
        if let Some(world) = &world {
            self.place_clouds(world, outputs)?;
            self.folder.write_text(folder::GEOREFERENCE, &world.to_json())?;
        }
        self.sync_clouds()?;
        let trajectory = world.as_ref().map(|world| world.trajectory(&self.trajectory));
        let trajectory = trajectory.as_ref().unwrap_or(&self.trajectory);
        for format in &self.settings.trajectory {
            let (name, text) = match format.as_str() {
                "kitti" => ("trajectory_kitti.txt", kitti_from_trajectory(trajectory)),
                "csv" => ("trajectory.csv", csv_from_trajectory(trajectory)),
                _ => ("trajectory.txt", tum_from_trajectory(trajectory)),
            };
            self.folder.write_text(name, &text)?;
        }
        let frame = world.as_ref().map_or("odometry, m", World::frame);
        self.folder.write_text(folder::INDEX, &Index::new(&self.clouds, frame).to_json())?;
        self.join.check_empty()
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let poses = self.trajectory.poses().iter();
        let head = State {
            clouds: self.clouds.clone(),
            join: self.join.save(),
            poses: poses
                .map(|(stamp, pose)| (stamp.0, pose.translation.vector.into(), pose.rotation.coords.into()))
                .collect(),
            placement: self.placement.as_ref().map(Received::to_bytes),
        };
        let mut state = StateBytes::with_head(STATE_VERSION, &head)?;
        self.join.save_messages(&mut state);
        state.rely_on(self.folder.files(&self.clouds[self.n_synced..]));
        self.n_synced = self.clouds.len();
        Ok(state)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let (state, messages): (State, _) = decode_head(STATE_VERSION, state)?;
        self.trajectory = geometry::Trajectory::default();
        for (stamp, translation, rotation) in state.poses {
            let world_from_body = messages::PoseRow { translation, rotation };
            self.push_pose(&StampedPose { stamp, world_from_body })?;
        }
        self.placement = state.placement.map(|bytes| Received::from_bytes(&bytes)).transpose()?;
        self.join.load(&state.join, messages)?;
        self.clouds = state.clouds;
        self.n_synced = self.clouds.len();
        self.folder.keep_only(&self.clouds)?;
        self.is_folder_clean = true;
        Ok(())
    }
}

impl Export {
    /// Before the first tick of a fresh run: clouds of an earlier run in the same folder go.
    fn prepare(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        if self.is_folder_clean {
            return Ok(());
        }
        for topic in &self.absent {
            outputs.note(format!("nobody publishes {topic}: the clouds are written without it"));
        }
        self.folder.keep_only(&self.clouds)?;
        self.is_folder_clean = true;
        Ok(())
    }

    fn push_pose(&mut self, row: &StampedPose) -> Result<(), StepError> {
        let stamp = Stamp(row.stamp);
        let pose = row.world_from_body.to_pose().ok_or_else(|| {
            StepError::data(format!("trajectory at {stamp}: {:?} is no rigid transform", row.world_from_body))
        })?;
        if self.trajectory.push(stamp, pose) {
            return Ok(());
        }
        Err(StepError::data(format!("trajectory at {stamp}: stamps must not fall")))
    }

    /// Where the submaps lie, once it is known.
    fn world(&self) -> Result<Option<World>, StepError> {
        self.placement.as_ref().map(|placement| World::new(placement, &self.settings)).transpose()
    }

    /// Moves the clouds to where they belong. While some are moved, others are brought to the disk.
    fn place_clouds(&mut self, world: &World, outputs: &mut Outputs) -> Result<(), StepError> {
        if world.lacks_map(&self.settings) {
            outputs.note("nothing says where on the Earth the drive was: coordinates are local, not UTM");
        }
        // Live, a stage that was started anew may have forgotten the beginning.
        let n_without = self.clouds.iter().filter(|entry| world.submap(entry.seq).is_none()).count();
        if n_without > 0 {
            outputs.count("clouds_without_place", n_without as u64);
        }
        let (folder, clouds, n_synced) = (&self.folder, &mut self.clouds, self.n_synced);
        let in_place = clouds[n_synced..].iter().filter(|entry| entry.is_placed());
        let in_place: Vec<PathBuf> = in_place.flat_map(|entry| folder.files(std::slice::from_ref(entry))).collect();
        to_disk::meanwhile(&in_place, |done| {
            clouds.chunks_mut(CLOUDS_AT_A_TIME).try_for_each(|clouds| {
                clouds.par_iter_mut().try_for_each(|entry| place::place(entry, folder, world, done))?;
                // A long drive has more clouds than a step has time for.
                outputs.mark_progress();
                Ok(())
            })
        })
    }

    /// Brings to the disk what is not there yet.
    fn sync_clouds(&mut self) -> Result<(), StepError> {
        to_disk::sync(&self.folder.files(&self.clouds[self.n_synced..]).collect::<Vec<_>>())?;
        self.n_synced = self.clouds.len();
        Ok(())
    }

    fn write_complete(&mut self, is_end: bool, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(joined) = self.join.next_complete(is_end) {
            self.write(&joined, outputs)?;
        }
        Ok(())
    }

    fn write(&mut self, joined: &Joined, outputs: &mut Outputs) -> Result<(), StepError> {
        if self.settings.formats.is_empty() {
            return Ok(());
        }
        let world = self.world()?;
        let place = world.as_ref().and_then(|world| Place::of(joined.submap.seq(), world));
        let entry = cloud::write(joined, &self.settings, &self.folder, place.as_ref())?;
        outputs.count("clouds", 1);
        outputs.count("points", entry.n_points);
        outputs.count("spectra", entry.spectra.as_ref().map_or(0, |spectra| spectra.n_spectra));
        outputs.count("lost_columns", joined.lost.len() as u64);
        self.clouds.push(entry);
        Ok(())
    }
}
