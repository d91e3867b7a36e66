//! The stage: release of submaps and exposures, and the report at the end.

mod columns;
mod doubts;
mod intake;

use crate::Settings;
use crate::saved::{self, Held};
use camera_alignment::report::OffsetReport;
use coloring::{AgeLimits, Bands, DoubtLimits, KnownBands, PointBuffers, ProjectionCamera};
use drive::CameraRig;
use files::problems::FileError;
use geometry::{Stamp, Trajectory};
use materials::{Model, PointMaterials};
use messages::{
    ColorTopic, CubeTopic, ImageTopic, MaterialTopic, Message, RegionTopic, SpectraTopic, SubmapTopic, TrajectoryTopic,
    UNSEEN,
};
use stage::{Context, Flow, Inputs, Mode, Outputs, Port, Problem, Received, Stage, StateBytes, StepError};
use std::path::Path;

/// Submaps held between two ticks; see the documentation of the crate.
const MAX_HELD: usize = 1;

/// Longest delay of an exposure after the poses around it, ns. Much more than a revolution of any LiDAR.
const MAX_LATENESS_NANOS: i64 = 2_000_000_000;

/// The stage.
pub struct Colorize {
    settings: Settings,
    max_age_nanos: i64,
    limits: AgeLimits,
    cameras: Vec<ProjectionCamera>,
    mosaics: Vec<ProjectionCamera>,
    /// Side of the filter pattern of each mosaic camera, px.
    patterns: Vec<u32>,
    bands: KnownBands,
    /// Whether images can arrive at all.
    has_images: bool,
    /// Whether cubes can arrive at all.
    has_cubes: bool,
    remark: Option<&'static str>,
    /// Names of the cameras.
    names: Vec<String>,
    /// Names of the mosaic cameras.
    mosaic_names: Vec<String>,
    /// `None`: materials are not requested.
    materials: Option<PointMaterials>,
    /// Offset, rad, and delay, s, above which a camera is reported.
    offset_limits: [f32; 2],
    limits_of_doubt: DoubtLimits,
    held: Held,
    buffers: PointBuffers,
}

impl Colorize {
    fn with_rig(settings: &Settings, vehicle: &CameraRig, context: &Context) -> Result<Self, StepError> {
        let rig = vehicle.rig();
        let n_cameras = rig.cameras.len();
        let n_mosaics = rig.mosaics.len();
        if n_cameras.max(n_mosaics) > usize::from(UNSEEN) {
            let text = format!(
                "drive.toml: {n_cameras} cameras and {n_mosaics} mosaic cameras; the limit is {UNSEEN} of each"
            );
            return Err(StepError::data(text));
        }
        let model = settings.materials.then(Model::built_in).transpose().map_err(StepError::data)?;
        let images = context.is_connected::<ImageTopic>();
        let cubes = context.is_connected::<CubeTopic>();
        Ok(Self {
            settings: settings.clone(),
            max_age_nanos: (settings.max_age_s * 1e9).round() as i64,
            limits: AgeLimits::new(settings.max_age_s, settings.max_moving_age_s),
            cameras: rig.cameras.iter().map(ProjectionCamera::from).collect(),
            mosaics: rig.mosaics.iter().map(ProjectionCamera::from).collect(),
            patterns: vehicle.mosaics().iter().map(|entry| entry.pattern).collect(),
            bands: KnownBands::new(vehicle.expected_bands()).map_err(StepError::data)?,
            has_images: images && n_cameras > 0,
            has_cubes: cubes && n_mosaics > 0,
            remark: (n_cameras == 0)
                .then_some("no cameras in this drive: points stay without color")
                .or((!images).then_some("no stage publishes images: points stay without color")),
            names: vehicle.cameras().iter().map(|entry| entry.name.clone()).collect(),
            mosaic_names: vehicle.mosaics().iter().map(|entry| entry.name.clone()).collect(),
            materials: model.map(PointMaterials::new),
            offset_limits: [settings.max_offset_mrad, settings.max_delay_ms].map(|limit| (limit * 1e-3) as f32),
            limits_of_doubt: DoubtLimits {
                min_colored_share: settings.min_colored_share,
                max_unused_share: settings.max_unused_exposures_share,
            },
            held: Held::default(),
            buffers: PointBuffers::default(),
        })
    }

    /// Whether all exposures that the submap may need have arrived. Without exposures, submaps do not wait for them.
    fn is_complete(&self, submap: &Received<SubmapTopic>) -> bool {
        let newest_pose = self.held.trajectory.poses().last();
        let until = submap.header().stamp_end.saturating_add(self.max_age_nanos);
        !(self.has_images || self.has_cubes) || newest_pose.is_some_and(|(stamp, _)| stamp.0 >= until)
    }

    /// The oldest submap, if it is due.
    fn next_due(&mut self, outputs: &mut Outputs) -> Option<Received<SubmapTopic>> {
        if !self.is_complete(self.held.submaps.front()?) {
            if self.held.submaps.len() <= MAX_HELD {
                return None;
            }
            outputs.count("submaps_colored_early", 1);
        }
        self.held.submaps.pop_front()
    }

    /// Reports the offset between points and images, and counts the cameras with a large one.
    fn report_offset(&self, outputs: &mut Outputs) {
        let report = OffsetReport::from_monitor(&self.held.monitor, &self.names, &self.cameras, self.offset_limits);
        report.lines.into_iter().for_each(|line| outputs.note(line));
        for is_large in report.are_large {
            outputs.count("cameras_with_known_offset", 1);
            outputs.count("cameras_with_large_offset", u64::from(is_large));
        }
    }

    /// Releases exposures and poses that no held or future submap needs.
    fn release(&mut self, outputs: &mut Outputs) {
        let held = &mut self.held;
        // The points of future submaps are later than the points of the newest submap.
        let oldest = held.submaps.front().map(|submap| submap.header().stamp_begin);
        if let Some(needed_from) = oldest.min(held.submaps_until).or(held.submaps_until) {
            let needed_from = needed_from.saturating_sub(self.max_age_nanos);
            held.images.release_before(needed_from, |stamp| has_pose(&held.trajectory, stamp));
            held.cubes.release_before(needed_from, |stamp| has_pose(&held.trajectory, stamp));
        }
        let n_excess = held.images.release_excess(ImageTopic::BORROWED, |stamp| has_pose(&held.trajectory, stamp))
            + held.cubes.release_excess(CubeTopic::BORROWED, |stamp| has_pose(&held.trajectory, stamp));
        outputs.count("exposures_released_early", n_excess);
        if let Some((newest, _)) = held.trajectory.poses().last() {
            let exposures = [held.images.oldest_stamp(), held.cubes.oldest_stamp()];
            let late = newest.0.saturating_sub(MAX_LATENESS_NANOS);
            let needed_from = exposures.into_iter().flatten().fold(late, i64::min);
            held.trajectory.forget_before(Stamp(needed_from));
        }
    }
}

/// The cameras of the recorded drive or of the live vehicle.
fn camera_rig(context: &Context) -> Result<CameraRig, FileError> {
    let open = if context.mode == Mode::Live { CameraRig::from_live } else { CameraRig::from_drive };
    open(&context.drive)
}

fn has_pose(trajectory: &Trajectory, stamp: i64) -> bool {
    trajectory.at(Stamp(stamp)).is_some()
}

impl Stage for Colorize {
    const NAME: &'static str = "colorize";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![
            Port::of::<SubmapTopic>(),
            Port::of::<TrajectoryTopic>(),
            Port::optional::<ImageTopic>(),
            Port::optional::<CubeTopic>(),
        ]
    }

    fn outputs() -> Vec<Port> {
        vec![
            Port::of::<ColorTopic>(),
            Port::of::<SpectraTopic>(),
            Port::of::<MaterialTopic>(),
            Port::of::<RegionTopic>(),
        ]
    }

    fn outputs_with(settings: &Settings, _launch_folder: &Path) -> Result<Vec<Port>, StepError> {
        let materials = settings.materials.then(Port::of::<MaterialTopic>);
        let regions = settings.regions.then(Port::of::<RegionTopic>);
        let always = [Port::of::<ColorTopic>(), Port::of::<SpectraTopic>()];
        Ok(always.into_iter().chain(materials).chain(regions).collect())
    }

    fn check(_settings: &Settings, context: &Context) -> Vec<Problem> {
        // Other problems of a recorded drive are reported by its source, problems of a live rig by calibrate.
        let Ok(vehicle) = camera_rig(context) else { return Vec::new() };
        let problem = Bands::new(&vehicle.expected_bands()).err();
        problem.map(|error| Problem::for_key("", error.to_string())).into_iter().collect()
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        Self::with_rig(settings, &camera_rig(context).map_err(StepError::io)?, context)
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.take_poses(inputs)?;
        self.take_exposures(inputs, outputs);
        for submap in inputs.take::<SubmapTopic>() {
            self.held.submaps_until = self.held.submaps_until.max(Some(submap.header().stamp_end));
            self.held.submaps.push_back(submap);
        }
        while let Some(submap) = self.next_due(outputs) {
            self.publish_columns(&submap, outputs)?;
        }
        self.release(outputs);
        Ok(Flow::Continue)
    }

    fn finish(&mut self, outputs: &mut Outputs) -> Result<(), StepError> {
        while let Some(submap) = self.held.submaps.pop_front() {
            self.publish_columns(&submap, outputs)?;
        }
        self.report_offset(outputs);
        let held = &mut self.held;
        held.images.release_all(|stamp| has_pose(&held.trajectory, stamp));
        held.cubes.release_all(|stamp| has_pose(&held.trajectory, stamp));
        self.report_doubts(outputs);
        Ok(())
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        saved::save(&self.held, self.bands.first_nm())
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        let bands_nm;
        (self.held, bands_nm) = saved::load(state)?;
        self.bands.resume(bands_nm).map_err(StepError::data)
    }
}
