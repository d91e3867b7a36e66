//! The materials of the points of a submap.

use crate::classifier::{Classifier, Probabilities};
use crate::smoothing::{Smoothing, mean_spectra, neighborhoods, votes};
use crate::spectra::Spectra;
use messages::MaterialRow;

/// Probabilities of the materials of points with these spectra and positions, m.
///
/// # Panics
/// If there is not one position for each spectrum.
pub fn materials_of(
    classifier: &Classifier,
    spectra: &Spectra,
    positions: &[[f32; 3]],
    smoothing: Smoothing,
) -> Vec<Probabilities> {
    assert_eq!(spectra.len(), positions.len(), "spectra and positions");
    if smoothing == Smoothing::Off {
        return classifier.classify(spectra);
    }
    let near = neighborhoods(positions);
    match smoothing {
        Smoothing::Off | Smoothing::Votes => votes(&classifier.classify(spectra), &near),
        Smoothing::Mean => classifier.classify(&mean_spectra(spectra, &near)),
        Smoothing::Both => votes(&classifier.classify(&mean_spectra(spectra, &near)), &near),
    }
}

/// The most probable material and its probability. Unknown with score 0 without any.
pub fn best_row(probabilities: &Probabilities) -> MaterialRow {
    let (mut material, mut most) = (0, 0.0);
    for (id, p) in (0..).zip(probabilities) {
        if *p > most {
            (material, most) = (id, *p);
        }
    }
    MaterialRow { material_id: material, score: (most * 255.0).round() as u8 }
}
