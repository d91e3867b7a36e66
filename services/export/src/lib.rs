//! export: joins the columns of each submap and writes the result files.
//!
//! | file | content |
//! |---|---|
//! | `clouds/submap_0003.ply` | all points of submap 3 with their columns, world frame (local east-north-up, m) |
//! | `clouds/submap_0003_spectra.ply` | the points that a mosaic camera saw, one float per band |
//! | `clouds/index.json` | for each cloud: file, points, stamps, bounds, pose, classes, instances |
//! | `trajectory.txt` | `world_from_body` at both ends of every sweep in TUM format (optionally `trajectory_kitti.txt`, `trajectory.csv`) |
//! | `georeference.json` | the world frame: its origin on the Earth, UTM zone, and the measurements that placed the submaps |
//!
//! | content | module |
//! |---|---|
//! | the columns joined to a submap: the table of columns, and further classes | `columns` |
//! | doubtful and refused results | `doubts` |
//! | disk space for the clouds | `space` |
//! | the files themselves | crate `delivery` |
//!
//! `export` must never change a value, drop a point or treat a column of points by its name: it joins, orders and
//! writes. Start with `Export::step`, then `columns.rs`.
//!
//! `export` writes a cloud when its last expected column has arrived. The expected columns are fixed before the start
//! (`Context::connected`), so files do not depend on timing. Clouds are synced to the disk before a state lists them. After a
//! restart, clouds that the state does not list are removed and written again.
//!
//! During the drive, clouds are in the frame of the odometry. At the end, topic `placement` contains the final pose of each submap
//! (`docs/explanation/georeferencing.md`): clouds and trajectory are moved to the final frame, and the last clouds are written
//! in it directly.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod columns;
mod doubts;
mod settings;
mod space;

pub use settings::{CloudFormat, Coordinates, Frame, Settings, TrajectoryFormat};

use columns::JoinedColumns;
use delivery::{
    CloudEntry, DeliveryError, Folder, FrameChoice, GEOREFERENCE, INDEX, Index, ReceivedSubmap, World, corrected,
    move_clouds, write_submap,
};
use formats::trajectory::{csv_from_trajectory, kitti_from_trajectory, tum_from_trajectory};
use geometry::Stamp;
use messages::columns::Presence;
use messages::{InstanceTopic, PlacementTopic, SpectraTopic, StampedPose, SubmapTopic, TrajectoryTopic};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use stage::{
    AllColumns, Bytes, ColumnTable, Context, Flow, Inputs, JoinedSubmap, Outputs, Port, Problem, Received, SavedColumn,
    Stage, StateBytes, StepError, SubmapJoin, decode_head,
};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Increased when [`State`] changes.
const STATE_VERSION: u32 = 5;
/// Number of clouds that are moved between two progress reports.
const CLOUDS_AT_A_TIME: usize = 4;

/// The sink of the pipeline. `C` is the table of columns that it joins.
pub struct Export<C: ColumnTable = AllColumns> {
    settings: Settings,
    folder: Folder,
    /// Topics without a publisher.
    absent: Vec<&'static str>,
    /// Columns that each submap should have.
    columns: JoinedColumns,
    join: SubmapJoin,
    clouds: Vec<CloudEntry>,
    /// Number of clouds, from the first on, that are synced to the disk.
    n_synced: usize,
    trajectory: geometry::Trajectory,
    /// Final poses of the submaps, once known.
    placed: Option<PlacedDrive>,
    /// Whether the folder contains the clouds of `clouds` and no other files of export.
    is_folder_clean: bool,
    table: PhantomData<C>,
}

/// The received placement, and the resulting final frame.
struct PlacedDrive {
    placement: Received<PlacementTopic>,
    world: World,
}

/// Saved state without the waiting messages, which follow it.
#[derive(Serialize, Deserialize)]
struct State {
    clouds: Vec<CloudEntry>,
    /// Submap, the columns in the order of the table, further classes.
    join: Vec<SavedColumn>,
    /// Poses of the trajectory.
    poses: Vec<(i64, [f64; 3], [f64; 4])>,
    placement: Option<Bytes>,
}

impl<C: ColumnTable> Stage for Export<C> {
    const NAME: &'static str = "export";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        let mut ports =
            vec![Port::of::<SubmapTopic>(), Port::of::<TrajectoryTopic>(), Port::optional::<PlacementTopic>()];
        ports.extend(C::ports().iter().map(|column| column.port.made_optional()));
        ports
    }

    fn inputs_with(settings: &Settings, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        Ok(Self::inputs().into_iter().chain(columns::further_ports(settings)).collect())
    }

    fn outputs() -> Vec<Port> {
        Vec::new()
    }

    fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        // Northings have millions of metres, where f32 resolves half a metre.
        let is_coarse = settings.frame == Frame::Utm && settings.coordinates == Coordinates::Float;
        let text = "must not be \"utm\" unless coordinates is \"double\": float resolves only half a metre there";
        let is_unplaced = settings.frame == Frame::Utm && !context.is_connected::<PlacementTopic>();
        let no_placement = "must not be \"utm\": no stage publishes placement, which moves the clouds to the world";
        let problems = [is_coarse.then_some(text), is_unplaced.then_some(no_placement)];
        let problems = problems.into_iter().flatten().map(|text| Problem::for_key("frame", text));
        problems.chain(space::lacks(settings, context, &JoinedColumns::new(C::ports(), settings, context))).collect()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let topics = Self::inputs();
        let table = C::ports();
        let is_connected = |topic: &str| context.connected.iter().any(|connected| connected == topic);
        // Columns that a setting adds are off by default, so their absence is not reported.
        let is_reported =
            |topic: &str| columns::by_topic(&table, topic).is_none_or(|c| c.presence == Presence::Default);
        let is_absent = |topic: &&'static str| !is_connected(topic) && is_reported(topic);
        let absent = topics.iter().map(Port::topic).filter(is_absent).collect();
        let columns = JoinedColumns::new(table, settings, context);
        Ok(Self {
            settings: settings.clone(),
            folder: Folder::new(&context.output),
            absent,
            join: columns.join(context.mode),
            columns,
            clouds: Vec::new(),
            n_synced: 0,
            trajectory: geometry::Trajectory::default(),
            placed: None,
            is_folder_clean: false,
            table: PhantomData,
        })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.prepare(outputs)?;
        for message in inputs.take::<TrajectoryTopic>() {
            message.rows().iter().try_for_each(|row| self.push_pose(row))?;
        }
        if let Some(last) = inputs.take::<PlacementTopic>().into_iter().next_back() {
            self.set_placement(last)?;
        }
        self.join.take(inputs)?;
        self.write_complete(false, outputs)?;
        self.join.check_bounds()?;
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        self.prepare(outputs)?;
        self.write_complete(true, outputs)?;
        self.move_clouds(outputs)?;
        if let Some(PlacedDrive { world, .. }) = &self.placed {
            self.folder.write_text(GEOREFERENCE, &world.to_json()).map_err(step_error)?;
        }
        self.sync_clouds()?;
        let world = self.placed.as_ref().map(|placed| &placed.world);
        let trajectory = world.map(|world| corrected(&self.trajectory, world.submaps()));
        let trajectory = trajectory.as_ref().unwrap_or(&self.trajectory);
        for format in &self.settings.trajectory {
            let (name, text) = match format {
                TrajectoryFormat::Tum => ("trajectory.txt", tum_from_trajectory(trajectory)),
                TrajectoryFormat::Kitti => ("trajectory_kitti.txt", kitti_from_trajectory(trajectory)),
                TrajectoryFormat::Csv => ("trajectory.csv", csv_from_trajectory(trajectory)),
            };
            self.folder.write_text(name, &text).map_err(step_error)?;
        }
        let frame = world.map_or("odometry, m", World::frame);
        self.folder.write_text(INDEX, &Index::new(&self.clouds, frame).to_json()).map_err(step_error)?;
        self.join.check_empty()?;
        self.report_doubts(outputs);
        self.check_utm()
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        let poses = self.trajectory.poses().iter();
        let head = State {
            clouds: self.clouds.clone(),
            join: self.join.save(),
            poses: poses
                .map(|(stamp, pose)| (stamp.0, pose.translation.vector.into(), pose.rotation.coords.into()))
                .collect(),
            placement: self.placed.as_ref().map(|placed| Bytes(placed.placement.to_bytes())),
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
            let odom_from_body = messages::PoseRow { translation, rotation };
            self.push_pose(&StampedPose { stamp, odom_from_body })?;
        }
        self.placed = None;
        if let Some(bytes) = state.placement {
            self.set_placement(Received::from_bytes(&bytes)?)?;
        }
        self.join.load(&state.join, messages)?;
        self.clouds = state.clouds;
        self.n_synced = self.clouds.len();
        self.folder.keep_only(&self.clouds).map_err(step_error)?;
        self.is_folder_clean = true;
        Ok(())
    }
}

impl<C: ColumnTable> Export<C> {
    /// Prepares the folder before the first tick of a new run: removes files of an earlier run.
    fn prepare(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        if self.is_folder_clean {
            return Ok(());
        }
        for topic in &self.absent {
            outputs.note(format!("topic {topic} has no publisher: clouds are written without it"));
        }
        self.folder.keep_only(&self.clouds).map_err(step_error)?;
        self.is_folder_clean = true;
        Ok(())
    }

    fn push_pose(&mut self, row: &StampedPose) -> Result<(), StepError> {
        let stamp = Stamp(row.stamp);
        let place = || format!("trajectory at {stamp}");
        let pose = row.odom_from_body.checked().map_err(|error| StepError::data(error).at(place()))?;
        if self.trajectory.push(stamp, pose) {
            return Ok(());
        }
        Err(StepError::data(format!("trajectory at {stamp}: the stamp is before the previous one")))
    }

    /// Uses the placement unless the clouds remain in the frame of the odometry.
    fn set_placement(&mut self, placement: Received<PlacementTopic>) -> Result<(), StepError> {
        let wants_utm = match self.settings.frame {
            Frame::Odom => {
                self.placed = None;
                return Ok(());
            }
            Frame::World => false,
            Frame::Utm => true,
        };
        let max_heading_deviation_deg = self.settings.max_heading_deviation_deg;
        let choice = FrameChoice { wants_utm, max_heading_deviation_deg };
        let world = World::new(placement.header(), placement.rows(), choice).map_err(step_error)?;
        self.placed = Some(PlacedDrive { placement, world });
        Ok(())
    }

    /// Moves the clouds to the final frame. While some are moved, others are synced to the disk.
    fn move_clouds(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        let Self { folder, clouds, placed, n_synced, .. } = self;
        let Some(PlacedDrive { world, .. }) = placed else { return Ok(()) };
        // In live mode, a restarted producer may lack the first submaps.
        let n_without = clouds.iter().filter(|entry| world.submap(entry.seq).is_none()).count();
        if n_without > 0 {
            outputs.count("clouds_without_place", n_without as u64);
        }
        let unsynced = clouds[*n_synced..].iter().filter(|entry| entry.is_placed());
        let unsynced: Vec<PathBuf> = unsynced.flat_map(|entry| folder.files(std::slice::from_ref(entry))).collect();
        delivery::sync_in_background(&unsynced, |finish| {
            clouds.chunks_mut(CLOUDS_AT_A_TIME).try_for_each(|clouds| {
                clouds.par_iter_mut().try_for_each(|entry| move_clouds(entry, folder, world, finish))?;
                // Moving the clouds of a long drive takes longer than a step may take without progress.
                outputs.mark_progress();
                Ok(())
            })
        })
        .map_err(step_error)
    }

    /// Syncs all clouds to the disk that are not synced yet.
    fn sync_clouds(&mut self) -> Result<(), StepError> {
        delivery::sync(&self.folder.files(&self.clouds[self.n_synced..]).collect::<Vec<_>>()).map_err(step_error)?;
        self.n_synced = self.clouds.len();
        Ok(())
    }

    fn write_complete(&mut self, is_end: bool, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(joined) = self.next_joined(is_end) {
            self.write(&joined, outputs)?;
        }
        Ok(())
    }

    /// The next submap whose columns are complete. At the end of a live run, missing columns count as lost.
    fn next_joined(&mut self, is_end: bool) -> Option<JoinedSubmap> {
        if is_end && self.join.is_live() { self.join.take_oldest() } else { self.join.next_complete() }
    }

    fn write(&mut self, joined: &JoinedSubmap, outputs: &mut Outputs) -> Result<(), StepError> {
        if self.settings.formats.is_empty() {
            return Ok(());
        }
        let columns = self.columns.received(joined)?;
        let submap = ReceivedSubmap {
            seq: joined.submap.seq(),
            header: joined.submap.header(),
            points: joined.submap.rows(),
            columns: &columns,
            spectra: joined.column::<SpectraTopic>().map(|column| (column.header(), column.rows())),
            moving: joined.column::<InstanceTopic>().map_or(&[], |column| column.header().moving()),
            lost: &joined.lost,
        };
        let coordinates = self.settings.coordinates.kind();
        let world = self.placed.as_ref().map(|placed| &placed.world);
        let entry = write_submap(&submap, coordinates, &self.folder, world).map_err(step_error)?;
        outputs.count("clouds", 1);
        outputs.count("points", entry.n_points);
        outputs.count("spectra", entry.spectra.as_ref().map_or(0, |spectra| spectra.n_spectra));
        outputs.count("lost_columns", joined.lost.len() as u64);
        self.clouds.push(entry);
        Ok(())
    }
}

fn step_error(error: DeliveryError) -> StepError {
    if error.is_of_files() { StepError::io(error) } else { StepError::data(error) }
}
