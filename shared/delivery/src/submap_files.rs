//! Writes the files of one submap.

use crate::error::DeliveryError;
use crate::folder::Folder;
use crate::index::CloudEntry;
use crate::place::{self, Place};
use crate::spectra;
use crate::submap_cloud::{ReceivedSubmap, SubmapColumns};
use crate::world::World;
use formats::ply::{Kind, Row};
use messages::{ClassRow, ClassTopic, ColorRow, ColorTopic, InstanceTopic, UNSEEN, class_name};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Writes the files of one submap, in the final frame if its placement is known. `coordinates` is the type of coordinates
/// in the files. The files are not synced, see [`crate::sync`].
pub fn write_submap(
    submap: &ReceivedSubmap<'_>,
    coordinates: Kind,
    folder: &Folder,
    world: Option<&World>,
) -> Result<CloudEntry, DeliveryError> {
    let place = world.and_then(|world| Place::find(submap.seq, world));
    let place = place.as_ref();
    let columns = SubmapColumns::new(submap, coordinates)?;
    let file = format!("clouds/submap_{:04}.ply", columns.seq);
    let encode = |i: usize, row: &mut Row<'_>| columns.encode(i, row);
    let n_points = columns.points.len();
    let place::WrittenCloud { bytes, bounds } =
        place::write_cloud(&folder.path(&file), columns.header(), n_points, encode, place)?;
    let header = submap.header;
    let mut entry = CloudEntry {
        seq: columns.seq,
        file,
        bytes,
        n_points: n_points as u64,
        stamp_begin: header.stamp_begin,
        stamp_end: header.stamp_end,
        bounds,
        translation: header.odom_from_submap.translation,
        rotation: header.odom_from_submap.rotation,
        sigma_m: None,
        sigma_rad: None,
        n_colored: submap.rows::<ColorTopic>().map(n_colored),
        classes: submap.rows::<ClassTopic>().map(class_counts),
        n_instances: submap.rows::<InstanceTopic>().map(n_instances),
        spectra: None,
        lost: submap.lost.iter().map(|topic| (*topic).to_owned()).collect(),
    };
    if let Some((head, words)) = submap.spectra {
        entry.spectra = Some(spectra::write(&columns, head, words, folder, place)?);
    }
    if let Some(place) = place {
        place.enter(&mut entry);
    }
    Ok(entry)
}

fn n_colored(color: &[ColorRow]) -> u64 {
    color.iter().filter(|row| row.camera != UNSEEN).count() as u64
}

fn class_counts(class: &[ClassRow]) -> BTreeMap<String, u64> {
    let mut counts = [0_u64; 256];
    for row in class {
        counts[usize::from(row.class_id)] += 1;
    }
    let mut by_name = BTreeMap::new();
    for (id, n) in (0..=u8::MAX).zip(counts).filter(|(_, n)| *n > 0) {
        *by_name.entry(class_name(id).to_owned()).or_default() += n;
    }
    by_name
}

fn n_instances(instance: &[u32]) -> u64 {
    let mut ids: Vec<u32> = instance.iter().copied().filter(|id| *id != 0).collect();
    ids.par_sort_unstable();
    ids.dedup();
    ids.len() as u64
}
