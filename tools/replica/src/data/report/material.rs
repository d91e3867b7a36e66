//! Data that a report reads in addition to the small files of the run: the drive, the clouds, pictures.

use super::bands::Bands;
use super::cloud_survey::CloudSurvey;
use super::finished_run::FinishedRun;
use super::moment::{MomentPoint, middle_of_path, points_around};
use super::overlays::overlays;
use super::range_picture::range_picture;
use crate::data::inspect::drive::pictures::{Picture, png};
use crate::data::inspect::drive::{DriveReport, Reading};
use drive::Drive;

/// Points around the moment of the range image, s: two revolutions at the usual 10 Hz, of which one is whole.
const SWEEP_HALF_S: f64 = 0.1;

/// All data that is read. Data that a run lacks is absent.
pub struct Material {
    pub drive: Option<Drive>,
    pub drive_report: Option<DriveReport>,
    pub survey: Option<CloudSurvey>,
    pub overlays: Vec<Picture>,
    /// Why overlays are missing.
    pub without_overlays: &'static str,
    pub range_picture: Option<Picture>,
    pub bands: Option<Bands>,
    pub band_charts: Option<[String; 2]>,
}

impl Material {
    /// Reads drive and clouds in parallel.
    pub fn from_run(run: &FinishedRun) -> anyhow::Result<Self> {
        let folder = run.drive();
        // A drive that was moved is not an error: the results exist.
        let drive = folder.as_ref().and_then(|folder| Drive::open(folder).ok());
        let of_drive = || {
            let report = drive
                .as_ref()
                .zip(folder.as_ref())
                .and_then(|(drive, folder)| DriveReport::from_drive(drive, folder, Reading::Stamps).ok());
            (report, Bands::from_run(run, drive.as_ref()))
        };
        let of_clouds = || (CloudSurvey::from_run(run), pictures(run, drive.as_ref()));
        let ((drive_report, bands), (survey, pictures)) = rayon::join(of_drive, of_clouds);
        let PicturesOfRun { overlays, without_overlays, range_picture } = pictures;
        let bands = bands?;
        let survey = survey?;
        let band_charts = bands.as_ref().map(Bands::charts);
        Ok(Self { drive, drive_report, survey, overlays, without_overlays, range_picture, bands, band_charts })
    }
}

/// Pictures of a moment of the run.
struct PicturesOfRun {
    overlays: Vec<Picture>,
    /// Why there are no overlays.
    without_overlays: &'static str,
    range_picture: Option<Picture>,
}

fn pictures(run: &FinishedRun, drive: Option<&Drive>) -> PicturesOfRun {
    let Some(stamp) = middle_of_path(run) else {
        let without_overlays = "There is no trajectory, so no points can be drawn over images.";
        return PicturesOfRun { overlays: Vec::new(), without_overlays, range_picture: None };
    };
    let points: Vec<MomentPoint> = points_around(run, stamp, SWEEP_HALF_S).unwrap_or_default();
    let range_picture = range_picture(&points).and_then(|image| png(String::new(), &image));
    let without_overlays = match drive {
        None => "The drive folder can no longer be read, so there are no images.",
        Some(drive) if drive.manifest().cameras.is_empty() && drive.manifest().mosaics.is_empty() => {
            "The drive has no cameras."
        }
        Some(drive) => {
            let overlays = overlays(run, drive, stamp);
            let without_overlays = "No image shows points of the clouds.";
            return PicturesOfRun { overlays, without_overlays, range_picture };
        }
    };
    PicturesOfRun { overlays: Vec::new(), without_overlays, range_picture }
}
