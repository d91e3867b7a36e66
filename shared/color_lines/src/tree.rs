//! The minimum spanning tree of spectra and its longest lines.

use serde::{Deserialize, Serialize};

/// A tree over nodes: node 0 is the origin, node i + 1 the spectrum of region i.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tree {
    /// For each node from node 1 on: the next node towards the origin, and the distance to it.
    pub toward_origin: Vec<(usize, f64)>,
}

/// A color line: a path of the tree outwards from its origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Nodes in order. The first line starts at the origin. Every other line starts after the node where it branches off
    /// an earlier one.
    pub nodes: Vec<usize>,
    /// Sum of the distances along the line, including the distance to the node where it branches off an earlier line.
    pub length: f64,
}

impl Tree {
    /// The minimum spanning tree of the origin and these spectra by Euclidean distance (Prim 1957). For equal distances,
    /// the node that joined first is preferred.
    pub fn new(spectra: &[Vec<f64>]) -> Self {
        let distance = |node: usize, other: usize| -> f64 {
            let a = &spectra[node - 1];
            let b = other.checked_sub(1).map(|other| &spectra[other]);
            let square = |(band, value): (usize, &f64)| (value - b.map_or(0.0, |b| b[band])).powi(2);
            a.iter().enumerate().map(square).sum::<f64>().sqrt()
        };
        let mut nearest: Vec<(usize, f64)> = (1..=spectra.len()).map(|node| (0, distance(node, 0))).collect();
        let mut outside: Vec<usize> = (1..=spectra.len()).collect();
        while !outside.is_empty() {
            let by_distance = |a: &usize, b: &usize| nearest[a - 1].1.total_cmp(&nearest[b - 1].1).then(a.cmp(b));
            let Some(joined) = outside.iter().copied().min_by(by_distance) else { break };
            outside.retain(|node| *node != joined);
            for node in &outside {
                let to_joined = distance(*node, joined);
                if to_joined < nearest[node - 1].1 {
                    nearest[node - 1] = (joined, to_joined);
                }
            }
        }
        Self { toward_origin: nearest }
    }

    /// All lines, longest first (thesis, algorithm 2): the longest path from the origin, then repeatedly the longest path
    /// when visited edges have length zero.
    ///
    /// A path that starts over visited edges is the longest one below the node where it leaves them. At each node, the
    /// longest branch therefore continues the line, and every other branch starts a new line.
    pub fn lines(&self) -> Vec<Line> {
        let n_nodes = self.toward_origin.len() + 1;
        let mut children = vec![Vec::new(); n_nodes];
        self.toward_origin.iter().zip(1..).for_each(|((parent, _), node)| children[*parent].push(node));
        // Nodes in an order in which each comes after the next one toward the origin.
        let mut order = vec![0];
        let mut next = 0;
        while next < order.len() {
            order.extend(&children[order[next]]);
            next += 1;
        }
        // The length of the longest path outwards from each node, and its first node.
        let mut onward = vec![(0.0_f64, None); n_nodes];
        for node in order.iter().rev().copied().filter(|node| *node > 0) {
            let (parent, step) = self.toward_origin[node - 1];
            let length = step + onward[node].0;
            // Ties go to the smaller node; the children of a parent come in descending order.
            if onward[parent].1.is_none() || length >= onward[parent].0 {
                onward[parent] = (length, Some(node));
            }
        }
        let line = |start: usize, length: f64| {
            let nodes = std::iter::successors(Some(start), |node| onward[*node].1).collect();
            Line { nodes, length }
        };
        let mut lines = vec![line(0, onward[0].0)];
        for (node, (parent, step)) in (1..).zip(&self.toward_origin) {
            if onward[*parent].1 != Some(node) {
                lines.push(line(node, step + onward[node].0));
            }
        }
        // The longest path from the origin stays first; the sort keeps the order of equal lines.
        lines[1..].sort_by(|a, b| b.length.total_cmp(&a.length));
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Figure 3.8 of the thesis: 0-1-4-5-6, 4-7-8, 1-10-11 and short branches.
    fn figure() -> Tree {
        let mut toward_origin = vec![(0, 0.0); 11];
        let edges =
            [(1, 0, 5.0), (4, 1, 4.0), (5, 4, 3.0), (6, 5, 3.0), (7, 4, 2.0), (8, 7, 3.0), (10, 1, 2.0), (11, 10, 2.5)];
        let branches = [(2, 1, 1.0), (3, 2, 0.5), (9, 5, 1.0)];
        for (node, parent, step) in edges.into_iter().chain(branches) {
            toward_origin[node - 1] = (parent, step);
        }
        Tree { toward_origin }
    }

    #[test]
    fn lines_of_the_example_are_those_of_the_thesis() {
        let lines = figure().lines();
        assert_eq!(lines[0], Line { nodes: vec![0, 1, 4, 5, 6], length: 15.0 });
        assert_eq!(lines[1], Line { nodes: vec![7, 8], length: 5.0 });
        assert_eq!(lines[2], Line { nodes: vec![10, 11], length: 4.5 });
        assert_eq!(lines.iter().map(|line| line.nodes.len()).sum::<usize>(), 12, "every node is on one line");
    }

    /// Literal implementation of algorithm 2.
    fn by_the_algorithm(tree: &Tree, k: usize) -> Vec<Vec<usize>> {
        let n = tree.toward_origin.len();
        let mut is_visited = vec![false; n + 1];
        let path = |mut node: usize| {
            let mut path = vec![node];
            while node > 0 {
                node = tree.toward_origin[node - 1].0;
                path.push(node);
            }
            path.reverse();
            path
        };
        let mut lines = Vec::new();
        for number in 0..k {
            let open = |node: &&usize| **node > 0 && !is_visited[**node];
            let length =
                |node: usize| path(node).iter().filter(open).map(|node| tree.toward_origin[node - 1].1).sum::<f64>();
            let Some(end) = (1..=n).max_by(|a, b| length(*a).total_cmp(&length(*b))) else { break };
            let mut line = if number == 0 { vec![0] } else { Vec::new() };
            line.extend(path(end).iter().filter(open));
            if line.is_empty() {
                break;
            }
            for node in &line {
                is_visited[*node] = true;
            }
            lines.push(line);
        }
        lines
    }

    #[test]
    fn lines_of_random_spectra_are_those_of_the_algorithm() {
        let mut random = random::Random::new(5);
        let spectra: Vec<Vec<f64>> = (0..60).map(|_| (0..5).map(|_| f64::from(random.unit())).collect()).collect();
        let tree = Tree::new(&spectra);
        let lines = tree.lines();
        let expected = by_the_algorithm(&tree, lines.len());
        assert_eq!(lines.iter().map(|line| line.nodes.clone()).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn tree_is_the_shortest_of_all_by_kruskal() {
        let mut random = random::Random::new(6);
        let spectra: Vec<Vec<f64>> = (0..40).map(|_| (0..3).map(|_| f64::from(random.unit())).collect()).collect();
        let at = |node: usize| if node == 0 { vec![0.0; 3] } else { spectra[node - 1].clone() };
        let distance = |a: usize, b: usize| at(a).iter().zip(at(b)).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
        let mut edges: Vec<(f64, usize, usize)> =
            (0..=40).flat_map(|a| (0..a).map(move |b| (a, b))).map(|(a, b)| (distance(a, b), a, b)).collect();
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut component: Vec<usize> = (0..=40).collect();
        let mut expected = 0.0;
        for (length, a, b) in edges {
            if component[a] != component[b] {
                expected += length;
                let from = component[a];
                let to = component[b];
                component.iter_mut().filter(|of| **of == from).for_each(|of| *of = to);
            }
        }
        let found: f64 = Tree::new(&spectra).toward_origin.iter().map(|(_, length)| length).sum();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}
