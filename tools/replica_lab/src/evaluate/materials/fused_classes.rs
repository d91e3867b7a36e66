//! Correction of a network's classes by spectra: green surfaces become plants, other surfaces become other classes.

use crate::evaluate::classes::NOT_SCORED;
use crate::materials::TownSpectra;
use materials::{Probabilities, best_row, mean_spectra, ndvi};
use messages::{ClassId, ClassRow, GROUND_CLASSES, MaterialId};
use neighbors::SpatialIndex;
use scores::Confusion;
use segmentation::{ModelInput, Segmenter};

/// Vegetation index above which a surface is green, and below which it is not. Between them nothing is changed.
const GREEN: [f32; 2] = [0.2, 0.4];
/// Neighbors that decide on a corrected class.
const N_NEAR: usize = 64;
/// Least score of a material, of 255, that changes a class.
const SURE: u8 = 200;
/// Score of a class, of 255, below which the network is unsure.
const UNSURE: u8 = 178;
/// Thresholds of [`FusedClasses::index`].
pub const THRESHOLDS: [f32; 5] = [0.2, 0.3, 0.4, 0.5, 0.6];

/// Counts of the points with a spectrum.
pub struct FusedClasses {
    /// Classes of the network; corrected by the vegetation index; by the material; by the material where the network is unsure.
    pub classes: [Confusion; 4],
    /// Confusion by threshold: whether the class is vegetation or terrain, whether the vegetation index is above the threshold.
    pub index: [Confusion; THRESHOLDS.len()],
}

/// Whether a surface is a green plant; `None` if this is not sure.
type IsGreen = Option<bool>;

impl FusedClasses {
    /// Counts without points.
    pub fn new() -> Self {
        let empty = || Confusion::new(ClassId::ALL.len());
        Self { classes: [empty(), empty(), empty(), empty()], index: THRESHOLDS.map(|_| Confusion::new(2)) }
    }

    /// Adds the points of a submap.
    pub fn add(
        &mut self,
        town: &TownSpectra,
        positions: &[[f32; 3]],
        found: &[Probabilities],
        segmenter: Option<&dyn Segmenter>,
    ) -> anyhow::Result<()> {
        let near = SpatialIndex::new(positions).nearest_of_own(N_NEAR);
        let mean = mean_spectra(&town.spectra, positions);
        let index: Vec<Option<f32>> = (0..mean.len()).map(|i| ndvi(mean.get(i))).collect();
        let truth = |i: usize| town.submap.truth[town.points[i] as usize];
        let is_scored = |i: &usize| !NOT_SCORED.iter().any(|not| *not as u8 == truth(*i));
        for (i, index) in index.iter().enumerate().filter(|(i, _)| is_scored(i)) {
            let Some(index) = index else { continue };
            let is_plant = [ClassId::Vegetation, ClassId::Terrain].iter().any(|class| *class as u8 == truth(i));
            for (threshold, confusion) in THRESHOLDS.iter().zip(&mut self.index) {
                confusion.add(usize::from(is_plant), usize::from(index > threshold));
            }
        }
        let Some(segmenter) = segmenter else { return Ok(()) };
        let mut rows = vec![ClassRow::default(); town.submap.points.len()];
        segmenter.segment(&ModelInput::new(&town.submap.header, &town.submap.points), &mut rows)?;
        let rows: Vec<ClassRow> = town.points.iter().map(|point| rows[*point as usize]).collect();
        let of_network: Vec<u8> = rows.iter().map(|row| row.class_id).collect();
        let by_index: Vec<IsGreen> = index.iter().map(|index| index.and_then(by_index)).collect();
        let by_material: Vec<IsGreen> = found.iter().map(by_material).collect();
        let is_unsure = |(row, is_green): (&ClassRow, &IsGreen)| is_green.filter(|_| row.score < UNSURE);
        let where_unsure: Vec<IsGreen> = rows.iter().zip(&by_material).map(is_unsure).collect();
        let corrections = [None, Some(by_index), Some(by_material), Some(where_unsure)];
        for (confusion, is_green) in self.classes.iter_mut().zip(corrections) {
            for i in (0..of_network.len()).filter(is_scored) {
                let others = || near.get(i).iter().map(|neighbor| neighbor.index as usize);
                let class =
                    is_green.as_ref().map_or(of_network[i], |is_green| corrected(i, &of_network, is_green, others()));
                confusion.add(usize::from(truth(i)), usize::from(class));
            }
        }
        Ok(())
    }
}

fn by_index(index: f32) -> IsGreen {
    let [low, high] = GREEN;
    (index < low || index > high).then_some(index > high)
}

fn by_material(probabilities: &Probabilities) -> IsGreen {
    let row = best_row(probabilities);
    match MaterialId::from_id(row.material_id) {
        Some(MaterialId::Vegetation) => (row.score >= SURE).then_some(true),
        Some(MaterialId::DryVegetation | MaterialId::Unknown) | None => None,
        Some(_) => (row.score >= SURE).then_some(false),
    }
}

/// The class of point `i` with its spectrum. A point of vegetation that is not green gets the most frequent class of its
/// neighbors that are not green.
fn corrected(i: usize, classes: &[u8], is_green: &[IsGreen], others: impl Iterator<Item = usize>) -> u8 {
    let class = classes[i];
    let is_one_of = |known: &[ClassId]| known.iter().any(|known| *known as u8 == class);
    match is_green[i] {
        Some(true) if is_one_of(&[ClassId::Vegetation, ClassId::Terrain]) => class,
        Some(true) if is_one_of(&GROUND_CLASSES) => ClassId::Terrain as u8,
        Some(true) => ClassId::Vegetation as u8,
        Some(false) if is_one_of(&[ClassId::Vegetation]) => {
            let mut n = [0_u32; ClassId::ALL.len()];
            let votes = others.filter(|other| is_green[*other] == Some(false));
            votes.for_each(|other| n[usize::from(classes[other])] += 1);
            n[ClassId::Vegetation as usize] = 0;
            let most = (0..n.len()).rev().max_by_key(|class| n[*class]).filter(|most| n[*most] > 0);
            most.map_or(class, |most| most as u8)
        }
        _ => class,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectra_correct_plants_only_where_they_are_sure() {
        let [road, vegetation, building] =
            [ClassId::Road, ClassId::Vegetation, ClassId::Building].map(|class| class as u8);
        let of = |class: u8, green: IsGreen| {
            let classes = [class, building, vegetation];
            corrected(0, &classes, &[green, Some(false), Some(true)], 0..3)
        };
        assert_eq!(of(road, Some(true)), ClassId::Terrain as u8);
        assert_eq!(of(building, Some(true)), vegetation);
        assert_eq!(of(vegetation, Some(false)), building);
        assert_eq!((of(vegetation, None), of(road, Some(false))), (vegetation, road));
        assert_eq!((by_index(0.1), by_index(0.3), by_index(0.7)), (Some(false), None, Some(true)));
    }
}
