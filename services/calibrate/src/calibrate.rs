//! The stage.

use crate::models::read_models;
use crate::references::{CubeCamera, CubeCameraError};
use crate::{ColorLines, Settings};
use color_lines::{CubeRegions, CubeSettings, Start};
use drive::CameraRig;
use drive::manifest::MosaicEntry;
use files::problems::FileError;
use formats::sensor_calibration::SensorCalibration;
use messages::{CubeTopic, MosaicHeader, MosaicTopic, pod::cast_slice_mut};
use rayon::prelude::*;
use spectral::median_3x3;
use stage::{
    Context, Flow, Inputs, Mode, Outputs, Port, Problem, Received, Stage, StateBytes, StepError, decode_state,
    encode_state,
};
use std::path::PathBuf;

/// Version of the saved state.
const STATE_VERSION: u32 = 1;

/// The stage; see the crate's page.
pub struct Calibrate {
    /// Cameras by index; the error is the reason why a camera gives no cubes. `None`: another stage handles the frames
    /// of the camera.
    cameras: Vec<Option<Result<CubeCamera, CubeCameraError>>>,
    median: bool,
    /// `None`: cubes have no regions.
    color_lines: Option<CubeSettings>,
    regions: CubeRegions,
}

/// The reason for skipping a frame.
struct Skip {
    /// Counter of the run summary.
    counter: &'static str,
    /// Note for the operator.
    note: String,
}

impl Calibrate {
    /// Publishes the cube of a frame. The outer error ends the run; the inner one skips only this frame.
    fn publish_cube(
        &mut self,
        frame: &Received<MosaicTopic>,
        outputs: &mut Outputs,
    ) -> Result<Result<(), Skip>, StepError> {
        let header = frame.header();
        let camera = match camera(&mut self.cameras, header) {
            Ok(Some(camera)) => camera,
            Ok(None) => return Ok(Ok(())),
            Err(skip) => return Ok(Err(skip)),
        };
        let n_samples = camera.spectral.mosaic().n_cells() * camera.spectral.mosaic().n_bands();
        let cube = camera.cube_header(header);
        let n_cells = cube.width as usize * cube.height as usize;
        let n_values = n_cells * cube.n_bands as usize;
        let n_rows = n_values + n_cells * if self.color_lines.is_some() { 2 } else { 1 };
        let mut loan = outputs.loan::<CubeTopic>(n_rows)?;
        *loan.header_mut() = cube;
        // All values, masks and regions are written before the loan is published.
        let rows = loan.grow_unset(n_rows)?;
        let (reflectances, rest) = rows.split_at_mut(n_values);
        let (masks, regions) = rest.split_at_mut(n_cells);
        let reflectances = cast_slice_mut(reflectances);
        let counts = camera.cube_into(frame.rows(), header.exposure_nanos, reflectances, masks);
        let counts = counts.and_then(|counts| {
            let smoothed =
                if self.median { median_3x3([cube.width, cube.height], reflectances, masks) } else { Ok(()) };
            smoothed.map(|()| counts)
        });
        let counts = match counts {
            Ok(counts) => counts,
            Err(error) => {
                return Ok(Err(Skip {
                    counter: "frames_unusable",
                    note: format!("mosaic camera {}: {error}", header.camera),
                }));
            }
        };
        if let Some(settings) = &self.color_lines
            && let Err(error) = self.regions.divide(&cube, settings, reflectances, masks, regions)
        {
            outputs.count("cubes_without_regions", 1);
            outputs.note(format!("mosaic camera {}: no regions: {error}", cube.camera));
        }
        outputs.count("samples", n_samples as u64);
        outputs.count("saturated_samples", counts.saturated);
        outputs.count("dead_samples", counts.dead);
        outputs.count("clipped_samples", counts.clipped);
        outputs.count("masked", counts.masked());
        outputs.publish(loan, frame.stamp()).map(Ok)
    }
}

/// Parameters of the division of cubes; `None` if they have no regions.
fn cube_settings(settings: &Settings) -> Option<CubeSettings> {
    let model = color_lines::Settings {
        start: Start::Count(settings.color_lines_gaussians as usize),
        ..color_lines::Settings::default()
    };
    let frames_per_model = if settings.color_lines_models.is_empty() { settings.color_lines_frames } else { u32::MAX };
    let simplifies = match settings.color_lines {
        ColorLines::Off => return None,
        ColorLines::Regions => false,
        ColorLines::Simplified => true,
    };
    Some(CubeSettings { model, frames_per_model, simplifies })
}

/// The cameras of the recorded drive or of the live vehicle.
fn camera_rig(context: &Context) -> Result<CameraRig, FileError> {
    match context.mode {
        Mode::Offline => CameraRig::from_drive(&context.drive),
        Mode::Live => CameraRig::from_live(&context.drive),
    }
}

/// The problem of `cameras`: a name that no mosaic camera has.
fn unknown_camera(settings: &Settings, rig: &CameraRig) -> Option<String> {
    let names: Vec<&str> = rig.mosaics().iter().map(|entry| entry.name.as_str()).collect();
    let unknown = settings.cameras.iter().find(|name| !names.contains(&name.as_str()))?;
    Some(format!("names {unknown}; the mosaic cameras of the drive are {}", names.join(", ")))
}

/// The folder that the setting names.
fn references(settings: &Settings, context: &Context) -> Option<PathBuf> {
    (!settings.references.is_empty()).then(|| context.launch_folder.join(&settings.references))
}

/// The cameras of the rig; `None` for cameras of another stage.
fn cameras(
    settings: &Settings,
    context: &Context,
    rig: &CameraRig,
) -> Vec<Option<Result<CubeCamera, CubeCameraError>>> {
    let folder = references(settings, context).unwrap_or_else(|| rig.folder().to_owned());
    let read = |(index, (entry, sensor)): (usize, (&MosaicEntry, &Option<SensorCalibration>))| {
        if !settings.cameras.is_empty() && !settings.cameras.contains(&entry.name) {
            return None;
        }
        let sensor = sensor.as_ref().filter(|_| settings.correction);
        Some(CubeCamera::read(&folder, index, entry, sensor, settings.demosaic.demosaicing()))
    };
    // In parallel, because the run starts when all stages are ready.
    rig.mosaics().par_iter().zip(rig.sensors()).enumerate().map(read).collect()
}

/// The camera of a frame; `None` if another stage handles the frame.
fn camera<'a>(
    cameras: &'a mut [Option<Result<CubeCamera, CubeCameraError>>],
    frame: &MosaicHeader,
) -> Result<Option<&'a mut CubeCamera>, Skip> {
    let index = frame.camera;
    let n_cameras = cameras.len();
    let camera = match cameras.get_mut(index as usize) {
        Some(None) => return Ok(None),
        Some(Some(Ok(camera))) => camera,
        Some(Some(Err(error))) => return Err(Skip { counter: "frames_without_reference", note: error.to_string() }),
        None => {
            let text = format!("mosaic camera {index}: the drive has {n_cameras} mosaic cameras");
            return Err(Skip { counter: "frames_unusable", note: text });
        }
    };
    if !camera.fits(frame) {
        let text = format!(
            "mosaic camera {index}: a frame of {}x{} px and {} bit does not fit the camera",
            frame.width, frame.height, frame.bit_depth
        );
        return Err(Skip { counter: "frames_unusable", note: text });
    }
    Ok(Some(camera))
}

impl Stage for Calibrate {
    const NAME: &'static str = "calibrate";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::optional::<MosaicTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<CubeTopic>()]
    }

    fn check(settings: &Settings, context: &Context) -> Vec<Problem> {
        let problem = |key: &str, text: String| vec![Problem::for_key(key, text)];
        if let Ok(rig) = camera_rig(context) {
            if let Some(unknown) = unknown_camera(settings, &rig) {
                return problem("cameras", unknown);
            }
            // Only now, because reading all references takes long.
            if !settings.color_lines_models.is_empty()
                && let Err(error) = read_models(settings, &context.launch_folder, &cameras(settings, context, &rig))
            {
                return problem("color_lines_models", error.to_string());
            }
        }
        match (context.mode, references(settings, context)) {
            (Mode::Offline, Some(_)) => {
                problem("references", "is for live runs; a recorded drive has its own dark and white frames".to_owned())
            }
            (Mode::Live, Some(folder)) if !folder.is_dir() => {
                problem("references", format!("{} is not a folder", folder.display()))
            }
            // Other problems of a recorded drive are reported by its source.
            (Mode::Live, _) => camera_rig(context).err().map_or(Vec::new(), |error| problem("", error.to_string())),
            (Mode::Offline, None) => Vec::new(),
        }
    }

    fn new(settings: &Settings, context: &Context) -> Result<Self, StepError> {
        let rig = camera_rig(context).map_err(StepError::io)?;
        let cameras = cameras(settings, context, &rig);
        let regions = read_models(settings, &context.launch_folder, &cameras).map_err(StepError::data)?;
        Ok(Self { cameras, median: settings.median, color_lines: cube_settings(settings), regions })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for frame in inputs.take::<MosaicTopic>() {
            if let Err(Skip { counter, note }) = self.publish_cube(&frame, outputs)? {
                outputs.count(counter, 1);
                outputs.note(note);
            }
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<StateBytes<'_>, StepError> {
        // Without regions, a cube depends on its frame alone.
        let state = self.color_lines.is_some().then(|| encode_state(STATE_VERSION, &self.regions)).transpose()?;
        Ok(state.map_or_else(StateBytes::default, StateBytes::from))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StepError> {
        self.regions = decode_state(STATE_VERSION, state)?;
        self.regions.check().map_err(StepError::data)
    }
}
