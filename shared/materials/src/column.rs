//! The materials of the points of a submap.

use crate::classifier::{Classifier, Method, Probabilities};
use crate::model::Model;
use crate::smoothing::{Smoothing, mean_spectra, region_means, votes};
use crate::spectra::Spectra;
use messages::{MATERIAL_TABLE_VERSION, MaterialHeader, MaterialId, MaterialRow, SpectraHeader, SubmapPoint};

/// Positions and regions of the points of spectra.
#[derive(Clone, Copy)]
pub struct Places<'a> {
    /// Positions, m.
    pub positions: &'a [[f32; 3]],
    /// Region of each point in a cube; 0 = no region. `None` if regions are not known.
    pub regions: Option<&'a [u32]>,
}

/// Probabilities of the materials of points with these spectra.
///
/// # Panics
/// If the numbers of positions and spectra differ, or the number of regions if they are known.
pub fn materials_of(
    classifier: &Classifier,
    spectra: &Spectra,
    places: Places<'_>,
    smoothing: Smoothing,
) -> Vec<Probabilities> {
    let Places { positions, regions } = places;
    assert_eq!(spectra.len(), positions.len(), "spectra and positions");
    assert!(regions.is_none_or(|regions| regions.len() == positions.len()), "regions and positions");
    if smoothing == Smoothing::Off {
        return classifier.classify(spectra);
    }
    let in_regions = |found: Vec<Probabilities>| match regions {
        Some(regions) => region_means(&found, regions, positions),
        None => found,
    };
    match smoothing {
        Smoothing::Off | Smoothing::Votes => votes(&classifier.classify(spectra), positions),
        Smoothing::Mean => classifier.classify(&mean_spectra(spectra, positions)),
        Smoothing::Both => votes(&classifier.classify(&mean_spectra(spectra, positions)), positions),
        Smoothing::Regions => in_regions(classifier.classify(spectra)),
        Smoothing::VotesInRegions => in_regions(votes(&classifier.classify(spectra), positions)),
    }
}

/// The most probable material and its probability. Without probabilities: unknown with score 0.
pub fn best_row(probabilities: &Probabilities) -> MaterialRow {
    let mut material = 0;
    let mut most = 0.0;
    for (id, p) in (0..).zip(probabilities) {
        if *p > most {
            material = id;
            most = *p;
        }
    }
    MaterialRow { material_id: material, score: (most * 255.0).round() as u8 }
}

/// Computes the material column of consecutive submaps.
pub struct PointMaterials {
    model: Model,
    /// Classifier for spectra with these bands, nm. The bands of a drive do not change, so it is computed once.
    classifier: Option<(Vec<f32>, Classifier)>,
}

impl PointMaterials {
    /// Uses the references of a model.
    pub fn new(model: Model) -> Self {
        Self { model, classifier: None }
    }

    /// Header and rows of the topic `material`, from the rows of the topic `spectra`. They are also smoothed over
    /// `regions` if each point has one. All points are unknown if the spectra do not fit their header.
    pub fn column(
        &mut self,
        points: &[SubmapPoint],
        header: &SpectraHeader,
        spectra: &[u32],
        regions: Option<&[u32]>,
    ) -> (MaterialHeader, Vec<MaterialRow>) {
        let mut rows = vec![MaterialRow::default(); points.len()];
        if let Some((indices, spectra)) = Spectra::from_column(header, spectra) {
            let position = |index: &u32| {
                let point = &points[*index as usize];
                [point.x, point.y, point.z]
            };
            let positions: Vec<[f32; 3]> = indices.iter().map(position).collect();
            let of_spectra = |regions: &[u32]| indices.iter().map(|index| regions[*index as usize]).collect();
            let regions: Option<Vec<u32>> = regions.map(of_spectra);
            let smoothing = if regions.is_some() { Smoothing::VotesInRegions } else { Smoothing::default() };
            let places = Places { positions: &positions, regions: regions.as_deref() };
            let found = materials_of(self.classifier(&spectra.wavelengths_nm), &spectra, places, smoothing);
            for (index, found) in indices.iter().zip(&found) {
                rows[*index as usize] = best_row(found);
            }
        }
        let n_known = rows.iter().filter(|row| row.material_id != MaterialId::Unknown as u8).count() as u64;
        (MaterialHeader { material_table_version: MATERIAL_TABLE_VERSION, n_known }, rows)
    }

    fn classifier(&mut self, wavelengths_nm: &[f32]) -> &Classifier {
        let made = self.classifier.take().filter(|(nm, _)| nm == wavelengths_nm);
        let made = made.unwrap_or_else(|| {
            (wavelengths_nm.to_vec(), Classifier::new(&self.model, wavelengths_nm, Method::default()))
        });
        &self.classifier.insert(made).1
    }
}
