//! The class tree of thesis figure 6.11.

use candle_core::{Device, Result, Tensor};
use messages::ClassId::{
    self, Bridge, Building, Fence, Ground, GuardRail, Pedestrian, Pole, RailTrack, Road, RoadLine, Sidewalk, Static,
    Terrain, TrafficLight, TrafficSign, Vegetation, Vehicles, Wall, Water,
};

use scores::Confusion;
use std::collections::BTreeSet;

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
    /// Takes the node of each class.
    pub fn new(node_of_class: Vec<usize>) -> Self {
        let n_nodes = node_of_class.iter().max().map_or(0, |last| last + 1);
        Self { node_of_class, n_nodes }
    }
    /// The tree of figure 6.11. A class that is not in the tree is its own node.
    pub fn from_classes(classes: &[ClassId]) -> Self {
        let mut n_nodes = TREE.len();
        let node = |class: &ClassId| {
            TREE.iter().position(|(_, leaves)| leaves.contains(class)).unwrap_or_else(|| {
                n_nodes += 1;
                n_nodes - 1
            })
        };
        Self { node_of_class: classes.iter().map(node).collect(), n_nodes }
    }
    /// A tree grown from confusions: while there are more than `n_nodes` nodes, the two nodes with the largest confusion
    /// are joined. The confusion of two nodes is the mean, over their pairs of classes, of the share of each class that
    /// is predicted as the other. Ties are resolved by the order of the classes.
    pub fn from_confusions(confusion: &Confusion, n_classes: usize, n_nodes: usize) -> Self {
        let share = |truth: usize, predicted: usize| {
            let n: u64 = (0..n_classes).map(|class| confusion.count(truth, class)).sum();
            confusion.count(truth, predicted) as f64 / n.max(1) as f64
        };
        let mut nodes: Vec<Vec<usize>> = (0..n_classes).map(|class| vec![class]).collect();
        while nodes.len() > n_nodes.max(1) {
            let of_pair = |&(first, second): &(usize, usize)| -> f64 {
                let first = &nodes[first];
                let second = &nodes[second];
                let pairs = first.iter().flat_map(|&a| second.iter().map(move |&b| share(a, b) + share(b, a)));
                pairs.sum::<f64>() / (first.len() * second.len()) as f64
            };
            let pairs = (0..nodes.len()).flat_map(|second| (0..second).map(move |first| (first, second)));
            let most = pairs.reduce(|best, pair| if of_pair(&pair) > of_pair(&best) { pair } else { best });
            let Some((first, second)) = most else { break };
            let joined = nodes.remove(second);
            nodes[first].extend(joined);
        }
        let node_of = |class: usize| nodes.iter().position(|node| node.contains(&class)).unwrap_or(0);
        Self::new((0..n_classes).map(node_of).collect())
    }
    /// Number of nodes that have classes.
    pub fn n_used_nodes(&self) -> usize {
        self.node_of_class.iter().collect::<BTreeSet<_>>().len()
    }
    /// The node of each class.
    pub fn node_of_class(&self) -> &[usize] {
        &self.node_of_class
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_that_are_confused_share_a_node() {
        let mut confusion = Confusion::new(5);
        for (truth, predicted, n) in
            [(0, 0, 90), (0, 3, 10), (1, 1, 50), (1, 4, 50), (2, 2, 7), (3, 3, 80), (3, 0, 20), (4, 4, 100)]
        {
            confusion.add_n(truth, predicted, n);
        }
        let nodes = |n| Hierarchy::from_confusions(&confusion, 5, n).node_of_class;
        assert_eq!(nodes(5), [0, 1, 2, 3, 4]);
        assert_eq!(nodes(4), [0, 1, 2, 3, 1], "half of class 1 is taken for class 4");
        assert_eq!(nodes(3), [0, 1, 2, 0, 1]);
        assert_eq!(nodes(0), [0; 5]);
        assert_eq!(
            Hierarchy::from_confusions(&Confusion::new(3), 3, 2).node_of_class,
            [0, 0, 1],
            "nothing is confused"
        );
    }
}
