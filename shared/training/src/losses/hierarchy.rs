//! The class tree of thesis figure 6.11.

use candle_core::{Device, Result, Tensor};
use messages::ClassId::{
    self, Bridge, Building, Fence, Ground, GuardRail, Pedestrian, Pole, RailTrack, Road, RoadLine, Sidewalk, Static,
    Terrain, TrafficLight, TrafficSign, Vegetation, Vehicles, Wall, Water,
};

/// Nodes of the first level and their classes.
const TREE: [(&str, &[ClassId]); 7] = [
    ("rideable", &[Road, RoadLine]),
    ("unrideable", &[Ground, Terrain, Sidewalk]),
    ("building-like", &[Building, Wall, Fence, Bridge]),
    ("other", &[RailTrack, GuardRail, Water, Static]),
    ("vegetation", &[Vegetation]),
    ("vertical", &[Pole, TrafficSign, TrafficLight]),
    ("movable", &[Pedestrian, Vehicles]),
];

/// The node of each class of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hierarchy {
    node_of_class: Vec<usize>,
    n_nodes: usize,
}

impl Hierarchy {
    /// From the node of each class.
    pub fn new(node_of_class: Vec<usize>) -> Self {
        let n_nodes = node_of_class.iter().max().map_or(0, |last| last + 1);
        Self { node_of_class, n_nodes }
    }
    /// The tree of figure 6.11. A class that is not in the tree is its own node.
    pub fn of_classes(classes: &[ClassId]) -> Self {
        let mut n_nodes = TREE.len();
        let node = |class: &ClassId| {
            TREE.iter().position(|(_, leaves)| leaves.contains(class)).unwrap_or_else(|| {
                n_nodes += 1;
                n_nodes - 1
            })
        };
        Self { node_of_class: classes.iter().map(node).collect(), n_nodes }
    }
    /// Name of the node of a class; `None` outside the tree.
    pub fn node_name(class: ClassId) -> Option<&'static str> {
        TREE.iter().find(|(_, leaves)| leaves.contains(&class)).map(|(name, _)| *name)
    }
    /// Matrix of classes x nodes with a one at the node of each class.
    pub(super) fn matrix(&self, device: &Device) -> Result<Tensor> {
        let mut ones = vec![0.0_f32; self.node_of_class.len() * self.n_nodes];
        for (class, node) in self.node_of_class.iter().enumerate() {
            ones[class * self.n_nodes + node] = 1.0;
        }
        Tensor::from_vec(ones, (self.node_of_class.len(), self.n_nodes), device)
    }
}
