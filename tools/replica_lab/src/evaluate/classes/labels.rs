//! The labels of real streets in the classes of this project.

use crate::evaluate::classes::seven;
use crate::evaluate::classes::tally::TrueClass;
use formats::semantic_kitti::{benchmark_id_of_label, class_of_label};
use messages::ClassId::{
    self, Building, Fence, Ground, GuardRail, Pedestrian, Pole, Road, RoadLine, Sidewalk, Static, Terrain, Unlabeled,
    Vegetation, Vehicles, Wall, Water,
};

/// A numbering of labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Labels {
    /// Ids of `SemanticKITTI`'s label files.
    SemanticKitti,
    /// Ids of RELLIS-3D (Jiang et al. 2021), an off-road data set.
    Rellis,
    /// Oakland 3-D, whose labels are converted by the import.
    Oakland,
}

impl Labels {
    /// The first numbering that defines all these ids.
    pub fn from_ids(ids: &[u16]) -> Option<Self> {
        [Self::SemanticKitti, Self::Rellis]
            .into_iter()
            .find(|labels| ids.iter().all(|id| labels.class_of(*id).is_some()))
    }

    /// The class of an id; `None` if the data set does not define it.
    fn class_of(self, id: u16) -> Option<ClassId> {
        match self {
            Self::SemanticKitti => class_of_label(id),
            Self::Rellis => rellis(id),
            Self::Oakland => None,
        }
    }

    /// The truth of a point; `None` if it is not scored.
    pub fn truth(self, id: u16) -> Option<TrueClass> {
        let class = self.class_of(id).filter(|class| *class != Unlabeled)?;
        let class = self.merged(class as u8);
        let seven = match self {
            Self::SemanticKitti => seven::from_benchmark_id(u32::from(benchmark_id_of_label(id)?)),
            _ => seven::from_truth(class),
        };
        Some(TrueClass { class, seven })
    }

    /// Merges classes that the labels do not distinguish.
    pub fn merged(self, class: u8) -> u8 {
        let Some(class) = ClassId::from_id(class) else { return class };
        let merged = match (self, class) {
            // Road lines are road everywhere; RELLIS-3D distinguishes only paved and unpaved ground.
            (_, RoadLine) | (Self::Rellis, Sidewalk) => Road,
            // Walls and guard rails are fences.
            (Self::SemanticKitti | Self::Rellis, Wall | GuardRail) => Fence,
            (Self::Rellis, Ground) => Terrain,
            (_, class) => class,
        };
        merged as u8
    }
}

/// RELLIS-3D's ontology. Sky, objects and logs are not scored; barriers are fences, rubble is terrain, puddles are water.
fn rellis(id: u16) -> Option<ClassId> {
    Some(match id {
        // Void, sky, object, log.
        0 | 7 | 9 | 15 => Unlabeled,
        // Dirt, grass, mud, rubble.
        1 | 3 | 33 | 34 => Terrain,
        // Tree, bush.
        4 | 19 => Vegetation,
        5 => Pole,
        // Water, puddle.
        6 | 31 => Water,
        8 => Vehicles,
        // Asphalt, concrete.
        10 | 23 => Road,
        12 => Building,
        17 => Pedestrian,
        // Fence, barrier.
        18 | 27 => Fence,
        29 => Static, // picnic table
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbering_is_recognized_by_its_ids() {
        assert_eq!(Labels::from_ids(&[0, 40, 70, 252]), Some(Labels::SemanticKitti));
        assert_eq!(Labels::from_ids(&[0, 3, 4, 19]), Some(Labels::Rellis));
        assert_eq!(Labels::from_ids(&[3, 40]), None);
    }

    #[test]
    fn truth_and_predictions_are_merged_alike() {
        let truth =
            |labels: Labels, id: u16| labels.truth(id).map(|truth| ClassId::from_id(truth.class).expect("known"));
        assert_eq!(truth(Labels::SemanticKitti, 60), Some(Road));
        assert_eq!(truth(Labels::SemanticKitti, 52), None);
        assert_eq!(truth(Labels::Rellis, 23), Some(Road));
        assert_eq!(Labels::Rellis.merged(Sidewalk as u8), Road as u8);
        assert_eq!(Labels::SemanticKitti.merged(Wall as u8), Fence as u8);
        assert_eq!(Labels::Oakland.merged(Wall as u8), Wall as u8);
        // Riders are pedestrians, but none of the seven classes.
        assert_eq!(Labels::SemanticKitti.truth(31).expect("is scored").seven, None);
    }
}
