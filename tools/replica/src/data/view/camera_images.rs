//! Images of the color cameras along the path, with the points over them. They are drawn when the page requests them.

use super::scene::SceneImage;
use crate::data::report::finished_run::FinishedRun;
use crate::data::report::overlays::overlay;
use drive::{Drive, Frame};
use file_server::{Content, Site};
use geometry::{Point3, Pose};
use std::sync::Arc;
use surveying::TargetFrame;
use surveying::crs::CrsError;

/// Width of a picture, px.
const WIDTH: u32 = 1200;

/// Exposures of a run that are shown.
pub struct CameraImages {
    run: FinishedRun,
    drive: Drive,
    chosen: Vec<Chosen>,
}

struct Chosen {
    frame: Frame,
    world_from_camera: Pose,
}

impl CameraImages {
    /// One exposure of each color camera every `step_m` of the path. `None` if the drive can no longer be read.
    pub fn open(run: FinishedRun, step_m: f64) -> Option<Self> {
        let drive = Drive::open(&run.drive()?).ok()?;
        let mut chosen = Vec::new();
        for (camera, known) in drive.rig().cameras.iter().enumerate() {
            let mut last: Option<Point3<f64>> = None;
            for frame in drive.camera_frames().iter().filter(|frame| frame.camera == camera) {
                let Some(world_from_body) = run.trajectory.at(frame.stamp) else { continue };
                let position = Point3::from(world_from_body.translation.vector);
                if last.is_none_or(|last| (position - last).norm() >= step_m) {
                    last = Some(position);
                    let world_from_camera = world_from_body * known.body_from_camera;
                    chosen.push(Chosen { frame: frame.clone(), world_from_camera });
                }
            }
        }
        Some(Self { run, drive, chosen })
    }

    /// Positions of the exposures.
    pub fn places(&self, target: &TargetFrame<'_>) -> Result<Vec<SceneImage>, CrsError> {
        let place = |(number, Chosen { frame, world_from_camera }): (usize, &Chosen)| {
            let at = |z: f64| target.from_local(&(world_from_camera * Point3::new(0.0, 0.0, z)));
            let camera = self.drive.manifest().cameras[frame.camera].name.clone();
            Ok(SceneImage { file: name(number), camera, position: at(0.0)?, ahead: at(1.0)? })
        };
        self.chosen.iter().enumerate().map(place).collect()
    }

    /// Adds the pictures.
    pub fn add_to(self: &Arc<Self>, site: &mut Site) {
        for number in 0..self.chosen.len() {
            let this = Arc::clone(self);
            let draw = move || {
                let picture = overlay(&this.run, &this.drive, &this.chosen[number].frame, WIDTH)?;
                Some(picture.into_bytes())
            };
            site.add(&name(number), Content::OnRequest(Box::new(draw)));
        }
    }
}

fn name(number: usize) -> String {
    format!("images/{number}.jpg")
}
