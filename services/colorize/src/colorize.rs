//! The stage: what is held, what is due, and what is said at the end.

mod columns;
mod intake;

use crate::Settings;
use crate::choose::Limits;
use crate::cloud::Memory;
use crate::offset_watch::{overview, overview_by_range, sentence};
use crate::saved::{self, Held};
use crate::spectra::Bands;
use crate::views::Camera;
use crate::window::{Exposure, Window};
use formats::drive::Drive;
use geometry::Stamp;
use intake::{expected_nm, too_many_bands};
use messages::{Color, Cube, Image, Spectra, Submap, Trajectory, UNSEEN};
use stage::{Context, Flow, Inputs, Outputs, Port, Received, Stage, StateBytes, StepError};

/// Submaps between two ticks; see the crate's documentation.
const MAX_HELD: usize = 1;

/// An exposure may come this much later than the poses around it, ns. Far above a revolution of any LiDAR.
const MAX_LATENESS_NANOS: i64 = 2_000_000_000;

/// The stage.
pub struct Colorize {
    max_age_nanos: i64,
    limits: Limits,
    cameras: Vec<Camera>,
    mosaics: Vec<Camera>,
    /// Of each mosaic camera the side of its filter pattern, px, and the bands that its cubes are expected to have.
    patterns: Vec<u32>,
    expected_nm: Vec<Vec<f32>>,
    /// What the bands really are: as expected, until a camera's first cube says otherwise.
    bands: Bands,
    /// Whether exposures may come at all; if not, submaps need not wait for them.
    sees: bool,
    remark: Option<&'static str>,
    /// Of the cameras.
    names: Vec<String>,
    level_exposures: bool,
    max_offset_rad: f32,
    max_delay_s: f32,
    held: Held,
    memory: Memory,
}

impl Colorize {
    fn with_drive(settings: &Settings, drive: &Drive, context: &Context) -> Result<Self, StepError> {
        let (rig, manifest) = (drive.rig(), drive.manifest());
        let (n_cameras, n_mosaics) = (rig.cameras.len(), rig.mosaics.len());
        if n_cameras.max(n_mosaics) > usize::from(UNSEEN) {
            let text = format!("{n_cameras} cameras and {n_mosaics} mosaic cameras; must be {UNSEEN} of each at most");
            return Err(StepError::data(text));
        }
        let expected_nm: Vec<Vec<f32>> = manifest
            .mosaics
            .iter()
            .zip(drive.sensors())
            .map(|(entry, sensor)| expected_nm(entry, sensor.as_ref()))
            .collect();
        let bands = Bands::new(&expected_nm).ok_or_else(|| too_many_bands(&expected_nm))?;
        let (images, cubes) = (context.is_connected::<Image>(), context.is_connected::<Cube>());
        Ok(Self {
            max_age_nanos: (settings.max_age_s * 1e9).round() as i64,
            limits: Limits {
                max_age_s: settings.max_age_s as f32,
                max_moving_age_s: settings.max_moving_age_s.min(settings.max_age_s) as f32,
            },
            cameras: rig.cameras.iter().map(Camera::from).collect(),
            mosaics: rig.mosaics.iter().map(Camera::from).collect(),
            patterns: manifest.mosaics.iter().map(|entry| entry.pattern).collect(),
            expected_nm,
            bands,
            sees: (images && n_cameras > 0) || (cubes && n_mosaics > 0),
            remark: match (n_cameras, images) {
                (0, _) => Some("no cameras in this drive: points stay without color"),
                (_, false) => Some("nobody publishes images: points stay without color"),
                _ => None,
            },
            names: manifest.cameras.iter().map(|entry| entry.name.clone()).collect(),
            level_exposures: settings.level_exposures,
            max_offset_rad: (settings.max_offset_mrad * 1e-3) as f32,
            max_delay_s: (settings.max_delay_ms * 1e-3) as f32,
            held: Held::default(),
            memory: Memory::default(),
        })
    }

    /// Whether all exposures that the submap may need have come.
    fn is_complete(&self, submap: &Received<Submap>) -> bool {
        let newest_pose = self.held.trajectory.poses().last();
        let until = submap.header().stamp_end.saturating_add(self.max_age_nanos);
        !self.sees || newest_pose.is_some_and(|(stamp, _)| stamp.0 >= until)
    }

    /// The oldest submap, if its time has come.
    fn next_due(&mut self, outputs: &mut Outputs) -> Option<Received<Submap>> {
        let is_complete = self.is_complete(self.held.submaps.front()?);
        if !is_complete {
            if self.held.submaps.len() <= MAX_HELD {
                return None;
            }
            outputs.count("submaps_colored_early", 1);
        }
        self.held.submaps.pop_front()
    }

    /// Says how far points and images are apart: once for all cameras, and once more for each that is too far off.
    fn report_offset(&self, outputs: &mut Outputs) {
        if self.held.watch.is_empty() {
            return;
        }
        let offset = self.held.watch.offset();
        outputs.note(overview(&self.names, &offset));
        let px_per_rad: Vec<f32> = self.cameras.iter().map(Camera::px_per_rad).collect();
        if let Some(line) = overview_by_range(&self.names, &px_per_rad, &self.held.watch, &offset) {
            outputs.note(line);
        }
        for (index, found) in offset.cameras.iter().enumerate().filter(|(_, found)| found.is_found()) {
            outputs.count("cameras_with_known_offset", 1);
            let is_far = found.exceeds(self.max_offset_rad);
            outputs.count("cameras_with_large_offset", u64::from(is_far));
            if is_far {
                let by_range = self.held.watch.by_range(index, &offset);
                outputs.note(sentence(&self.names[index], self.cameras[index].px_per_rad(), found, &by_range));
            }
        }
        if let Some([delay_s, deviation_s]) =
            offset.delay_s.filter(|[delay_s, sigma_s]| delay_s.abs() - 3.0 * sigma_s > self.max_delay_s)
        {
            outputs.note(format!(
                "images were taken {:.1} +- {:.1} ms after their stamps",
                1e3 * delay_s,
                1e3 * deviation_s
            ));
        }
    }

    /// Lets go of what no held or future submap needs.
    fn release(&mut self, outputs: &mut Outputs) {
        let held = &mut self.held;
        // The points of future submaps come after those of the newest.
        let oldest = held.submaps.front().map(|submap| submap.header().stamp_begin);
        if let Some(needed_from) = oldest.min(held.submaps_until).or(held.submaps_until) {
            let needed_from = needed_from.saturating_sub(self.max_age_nanos);
            held.images.release_before(needed_from);
            held.cubes.release_before(needed_from);
        }
        let n_excess = held.images.release_excess() + held.cubes.release_excess();
        outputs.count("exposures_released_early", n_excess);
        if let Some((newest, _)) = held.trajectory.poses().last() {
            let exposures = [oldest_stamp(&held.images), oldest_stamp(&held.cubes)];
            let late = newest.0.saturating_sub(MAX_LATENESS_NANOS);
            let needed_from = exposures.into_iter().flatten().fold(late, i64::min);
            held.trajectory.forget_before(Stamp(needed_from));
        }
    }
}

fn oldest_stamp<T: Exposure>(window: &Window<T>) -> Option<i64> {
    window.exposures().first().map(Received::stamp)
}

impl Stage for Colorize {
    const NAME: &'static str = "colorize";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<Submap>(), Port::of::<Trajectory>(), Port::optional::<Image>(), Port::optional::<Cube>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<Color>(), Port::of::<Spectra>()]
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let drive = Drive::open(&context.drive).map_err(StepError::io)?;
        Self::with_drive(settings, &drive, context)
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        self.take_poses(inputs)?;
        self.take_exposures(inputs, outputs);
        for submap in inputs.take::<Submap>() {
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
        Ok(())
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        saved::save(&self.held)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.held = saved::load(state)?;
        self.bands = self.known_bands()?;
        Ok(())
    }
}
