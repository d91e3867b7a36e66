//! What every model can do.

use crate::ground::{self, GroundQuasiFlat};
use crate::model_file::ModelFile;
use crate::spherical::{self, Refinement, SphericalModel};
use crate::{LearningError, ModelCard};
use messages::{ClassRow, ColorRow, SubmapHeader, SubmapPoint};
use std::path::Path;

/// A submap as a model sees it, borrowed where it lies.
#[derive(Clone, Copy)]
pub struct Cloud<'a> {
    /// Sweeps and sensor positions.
    pub header: &'a SubmapHeader,
    /// Submap frame: z up within the tilt of the vehicle, m.
    pub points: &'a [SubmapPoint],
    /// A color for every point, if the drive has cameras.
    pub colors: Option<&'a [ColorRow]>,
}

/// What is worth knowing about one submap beside its classes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Points that the model could not look at: not finite, or too far from the sensor.
    pub n_unseen: usize,
    /// Factor by which the model's raster had to be coarsened to stay within its bounds, 1 if it had not.
    pub coarsened: u32,
}

/// Gives every point a class and a score.
pub trait Segmenter: Send {
    /// What the model's file says about it.
    fn card(&self) -> &ModelCard;

    /// Writes the class of each point of the cloud, in order. The same cloud gets the same classes, always.
    ///
    /// Scores are 0 to 255 for 0 to 1. A point that the model has nothing to say about is
    /// [`messages::ClassId::Unlabeled`] with score 0.
    fn segment(&self, cloud: &Cloud<'_>, classes: &mut [ClassRow]) -> Result<Report, LearningError>;
}

/// How to run a model: what its file does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Of so many sweeps of a submap, one is looked at; 1 for all. Models that do not look at sweeps look at everything.
    pub every: usize,
    /// Corrections of the network's classes, none by default.
    pub refinement: Refinement,
}

impl Default for Options {
    fn default() -> Self {
        Self { every: 1, refinement: Refinement::default() }
    }
}

/// Names of the architectures.
const KNOWN: &str = "ground_quasi_flat, spherical";

/// Reads a model file. It is refused, with the reason, if it is cut off, of an unknown architecture or version, or if a
/// setting or tensor is not as the architecture needs it.
///
/// # Errors
/// See [`LearningError`].
pub fn load(path: &Path, options: &Options) -> Result<Box<dyn Segmenter>, LearningError> {
    let file = ModelFile::read(path)?;
    match file.card.architecture.as_str() {
        ground::ARCHITECTURE => Ok(Box::new(GroundQuasiFlat::from_file(&file)?)),
        spherical::ARCHITECTURE => Ok(Box::new(SphericalModel::from_file(&file)?.with_options(*options))),
        got => Err(LearningError::Architecture { path: path.into(), got: got.to_owned(), known: KNOWN }),
    }
}

impl Cloud<'_> {
    /// Refuses columns of other lengths than the points.
    pub(crate) fn check(&self, classes: &[ClassRow]) -> Result<(), LearningError> {
        let expected = self.points.len();
        let columns = [("class column", Some(classes.len())), ("color column", self.colors.map(<[ColorRow]>::len))];
        for (what, len) in columns {
            if let Some(got) = len.filter(|&got| got != expected) {
                return Err(LearningError::Length { what, got, expected });
            }
        }
        Ok(())
    }
}
