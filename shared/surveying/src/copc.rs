//! Cloud-Optimized Point Clouds (COPC 1.0, <https://copc.io>): LAZ whose chunks are the nodes of an octree, so that a
//! viewer loads only the visible part.
//!
//! `copc_converter` creates the same format from LAZ files. It needs 86 crates, including an older laz and an allocator
//! in C.
//!
//! A point belongs to the first node, counted from the root, whose voxel at the point is free. A node has 128 voxels per
//! side. Blocks of the drive are processed one after the other, so the voxels of only a few nodes are in memory. Two
//! temporary files hold the points: first by block, then by node.

mod file;
mod octree;

use crate::cloud_delivery::{CloudDelivery, CloudOptions, metres};
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use crate::spool::{KeyedRecords, Spool};
use crate::target_frame::TargetFrame;
use crate::tiles::PointFile;
use octree::{Node, NodeKey, Octree, block_of};
use std::collections::BTreeMap;
use std::path::Path;

/// Number of points assigned to nodes at a time.
const POINTS_AT_A_TIME: usize = 1 << 18;
/// A node that has at most this many points, including the points of its descendants, takes all of them. More nodes would
/// cost a viewer more requests.
const MERGED_POINTS: u64 = 20_000;

/// Writes all points of runs as `name` into the existing folder `out`. `progress` receives numbers of points: each point
/// is read, assigned to a node and written.
pub fn write_copc(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    options: &CloudOptions,
    out: &Path,
    name: &str,
    mut progress: impl FnMut(u64),
) -> Result<PointFile, DeliverError> {
    let mut delivery = CloudDelivery::new(runs, frame, options)?;
    let blocks = delivery.spool(out, block_of, &mut progress)?;
    let places: Vec<[i16; 3]> = blocks.keys().into_iter().map(|block| block.key).collect();
    let octree = Octree::from_blocks(&places);
    let order = octree.order(places);
    let nodes = Spool::create(out, delivery.facts.record_bytes)?;
    let nodes = place(&octree, &blocks, order, nodes, &mut progress)?;
    drop(blocks);
    let merged = merged(&nodes.keys());
    let extent = file::write(&out.join(name), &delivery, &octree, &nodes, &merged, &mut progress)?;
    let bounds = extent.bounds.map(|corner| metres(corner, delivery.facts.offset_m));
    Ok(PointFile { file: name.to_owned(), n_points: extent.n_points, bounds })
}

/// Assigns each point of the blocks, in this order, to a node. Adds the points to `nodes`, which is empty.
fn place(
    octree: &Octree,
    blocks: &Spool<[i16; 3]>,
    order: Vec<[i16; 3]>,
    mut nodes: Spool<NodeKey>,
    mut progress: impl FnMut(u64),
) -> Result<Spool<NodeKey>, DeliverError> {
    let record_bytes = nodes.record_bytes();
    let mut root = Node::default();
    for block in order {
        root.forget_all_but(octree, block);
        blocks.each_piece(&block, POINTS_AT_A_TIME, |records| {
            let keys = octree.place(&mut root, records, record_bytes);
            progress(keys.len() as u64);
            nodes.add(records, &keys)
        })?;
    }
    Ok(nodes)
}

/// Nodes, each with the nodes whose points it takes.
fn merged(nodes: &[KeyedRecords<NodeKey>]) -> BTreeMap<NodeKey, Vec<NodeKey>> {
    let mut totals: BTreeMap<NodeKey, u64> = BTreeMap::new();
    for KeyedRecords { key, n: n_points } in nodes {
        for ancestor in key.path_from_root() {
            *totals.entry(ancestor).or_default() += n_points;
        }
    }
    let mut merged: BTreeMap<NodeKey, Vec<NodeKey>> = BTreeMap::new();
    for KeyedRecords { key, .. } in nodes {
        let small = key.path_from_root().find(|ancestor| totals[ancestor] <= MERGED_POINTS);
        merged.entry(small.unwrap_or(*key)).or_default().push(*key);
    }
    merged
}
