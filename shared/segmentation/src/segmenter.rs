//! The interface of all models.

use crate::intensity::ForeignIntensity;
use crate::refinement::Refinement;
use crate::{CellProbabilities, LidarAboveGround, ModelCard, SegmentationError};
use ground::{Ground, SubmapGround};
use messages::{ClassId, ClassRow, ColorRow, SpectraHeader, SpectraView, SubmapHeader, SubmapPoint};
use std::sync::Arc;

/// The input of a model: a submap, in place.
#[derive(Clone, Copy)]
pub struct ModelInput<'a> {
    /// Sweeps and sensor positions.
    pub header: &'a SubmapHeader,
    /// Points in the submap frame: z is up within the tilt of the vehicle, m.
    pub points: &'a [SubmapPoint],
    /// A color for every point, if the drive has cameras.
    pub colors: Option<&'a [ColorRow]>,
    /// The spectra of the points, if the drive has hyperspectral cameras.
    pub spectra: Option<SpectraColumn<'a>>,
}

/// A message of the topic `spectra`, in place.
#[derive(Clone, Copy)]
pub struct SpectraColumn<'a> {
    /// Bands and counts.
    pub header: &'a SpectraHeader,
    /// Index of the spectrum of each point, then the spectra.
    pub rows: &'a [u32],
}

impl<'a> SpectraColumn<'a> {
    /// The spectra of the points; `None` if the number of rows does not fit the header.
    pub(crate) fn view(&self) -> Option<SpectraView<'a>> {
        SpectraView::new(self.header, self.rows)
    }
}

/// Diagnostics of one submap.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Report {
    /// Points that the model could not classify: not finite, or too far from the LiDAR.
    pub n_unseen: usize,
    /// Points that lost their class because of their score, see [`crate::UnknownBelow`].
    pub n_unknown: usize,
    /// Factor by which the cells of the model's grid were enlarged to stay within its memory limit; 1 if they were not.
    pub coarsened: u32,
    /// Median intensities of the ground, if they show that the intensities are not on the scale of the training data.
    pub foreign_intensity: Option<ForeignIntensity>,
    /// The LiDAR above the ground near its path.
    pub lidar: LidarAboveGround,
}

/// Assigns a class and a score to every point.
pub trait Segmenter: Send {
    /// Identification of the model.
    fn card(&self) -> &ModelCard;

    /// Writes the class of each point, in order. Equal inputs give equal classes.
    ///
    /// Scores are 0 to 255 for 0 to 1. A point that the model cannot classify is
    /// [`messages::ClassId::Unlabeled`] with score 0. [`crate::UnknownBelow`] makes further points unlabeled, which keep their score.
    fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError>;
}

/// A model that computes probabilities of its classes in cells of the submap.
pub trait CellSegmenter: Segmenter {
    /// The classes of the probabilities, in order.
    fn classes(&self) -> &[ClassId];
    /// Corrections of the classes of points, applied after the choice of the most probable classes.
    fn refinement(&self) -> Refinement;
    /// Computes the probabilities from the submap and the ground below it.
    fn probabilities(
        &self,
        input: &ModelInput<'_>,
        ground: &Arc<SubmapGround>,
    ) -> Result<SubmapProbabilities, SegmentationError>;
}

/// Result of a [`CellSegmenter`] for a submap.
pub struct SubmapProbabilities {
    /// Probabilities of the classes in cells of the submap.
    pub cells: CellProbabilities,
    /// Diagnostics, without unlabeled points.
    pub report: Report,
}

impl<'a> ModelInput<'a> {
    /// Creates the input of a submap without colors and spectra.
    pub fn new(header: &'a SubmapHeader, points: &'a [SubmapPoint]) -> Self {
        Self { header, points, colors: None, spectra: None }
    }
    /// The ground below the submap.
    pub fn ground(&self) -> Ground {
        Ground::find(self.header, self.points)
    }
    /// Checks that all columns have one row per point.
    pub(crate) fn check(&self, classes: &[ClassRow]) -> Result<(), SegmentationError> {
        self.check_length("class column", classes.len())?;
        self.check_columns()
    }
    /// Checks the columns that a model reads, like [`Self::check`].
    pub(crate) fn check_columns(&self) -> Result<(), SegmentationError> {
        self.colors.map_or(Ok(()), |colors| self.check_length("color column", colors.len()))?;
        let expected = self.points.len();
        if let Some(spectra) = self.spectra {
            let found = spectra.header.n_points as usize;
            if found != expected || spectra.view().is_none() {
                return Err(SegmentationError::Length {
                    column: "spectra column",
                    found: spectra.rows.len(),
                    expected,
                });
            }
        }
        Ok(())
    }
    fn check_length(&self, column: &'static str, found: usize) -> Result<(), SegmentationError> {
        let expected = self.points.len();
        if found == expected { Ok(()) } else { Err(SegmentationError::Length { column, found, expected }) }
    }
}
