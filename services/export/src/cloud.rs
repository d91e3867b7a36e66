//! The cloud of a submap: fields of the Paris-CARLA-3D profile, then ours.

use crate::folder::Folder;
use crate::index::CloudEntry;
use crate::join::Joined;
use crate::place::{self, Place, odometry_frame};
use crate::sweeps::Placement;
use crate::{Settings, spectra};
use formats::ply::{Header, Kind, Row};
use messages::{
    CLASS_TABLE_VERSION, ClassId, ClassRow, ColorRow, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, Submap, SubmapPoint,
    UNSEEN, class_name,
};
use rayon::prelude::*;
use stage::{Received, StepError};
use std::collections::BTreeMap;

/// A joined submap as slices of one length.
pub(crate) struct Cloud<'a> {
    pub(crate) seq: u64,
    pub(crate) points: &'a [SubmapPoint],
    pub(crate) placement: Placement,
    color: Option<&'a [ColorRow]>,
    class: Option<&'a [ClassRow]>,
    instance: Option<&'a [u32]>,
    pub(crate) coordinates: Kind,
}

/// Writes the files of one submap, in its place if that is known; bringing them to the disk is left to [`crate::to_disk`].
pub(crate) fn write(
    joined: &Joined,
    settings: &Settings,
    folder: &Folder,
    place: Option<&Place<'_>>,
) -> Result<CloudEntry, StepError> {
    let cloud = Cloud::new(joined, settings)?;
    let file = format!("clouds/submap_{:04}.ply", cloud.seq);
    let encode = |i: usize, row: &mut Row<'_>| cloud.encode(i, row);
    let (bytes, bounds) = place::write(&folder.path(&file), cloud.header(), cloud.points.len(), encode, place)?;
    let header = joined.submap.header();
    let mut entry = CloudEntry {
        seq: cloud.seq,
        file,
        bytes,
        n_points: cloud.points.len() as u64,
        stamp_begin: header.stamp_begin,
        stamp_end: header.stamp_end,
        bounds,
        translation: header.world_from_submap.translation,
        rotation: header.world_from_submap.rotation,
        sigma_m: None,
        sigma_rad: None,
        n_colored: cloud.color.map(n_colored),
        classes: cloud.class.map(class_counts),
        n_instances: cloud.instance.map(n_instances),
        spectra: None,
        lost: joined.lost.clone(),
    };
    if let Some(column) = &joined.spectra {
        entry.spectra = Some(spectra::write(&cloud, column, folder, place)?);
    }
    if let Some(place) = place {
        place.enter(&mut entry);
    }
    Ok(entry)
}

impl<'a> Cloud<'a> {
    fn new(joined: &'a Joined, settings: &Settings) -> Result<Self, StepError> {
        let Joined { submap, color, class, instance, .. } = joined;
        let seq = submap.seq();
        let n = submap.rows().len();
        let placement = Placement::new(submap.header(), seq)?;
        placement.check(submap.rows(), seq)?;
        let instance = instance.as_ref().map(|column| column_rows(column.rows(), "instance", submap, n)).transpose()?;
        if let Some(id) = instance.and_then(|ids| ids.iter().copied().max()).filter(|id| i32::try_from(*id).is_err()) {
            return Err(StepError::data(format!("instance of submap {seq}: id {id} does not fit an int")));
        }
        Ok(Self {
            seq,
            points: submap.rows(),
            placement,
            color: color.as_ref().map(|column| column_rows(column.rows(), "color", submap, n)).transpose()?,
            class: class.as_ref().map(|column| column_rows(column.rows(), "class", submap, n)).transpose()?,
            instance,
            coordinates: if settings.coordinates == "double" { Kind::Double } else { Kind::Float },
        })
    }

    fn header(&self) -> Header {
        let mut header = Header::new([
            ("x", self.coordinates),
            ("y", self.coordinates),
            ("z", self.coordinates),
            ("x_lidar_position", self.coordinates),
            ("y_lidar_position", self.coordinates),
            ("z_lidar_position", self.coordinates),
            ("cos_angle_lidar_surface", Kind::Float),
            ("timestamp", Kind::Double),
            ("index_frame", Kind::Int),
            ("intensity", Kind::UChar),
            ("ring", Kind::UChar),
            ("azimuth_deg", Kind::Float),
            ("elevation_deg", Kind::Float),
            ("dynamic", Kind::UChar),
        ])
        .comment(format!("REPLICA submap {}", self.seq))
        .info(odometry_frame())
        .info("timestamp s since 1970-01-01T00:00:00Z")
        .info("cos_angle_lidar_surface -1 where unknown");
        let mut add = |fields: &[(&str, Kind)], info: String| {
            header.properties.extend(Header::new(fields.iter().copied()).properties);
            header.infos.push(info);
        };
        if self.instance.is_some() {
            add(&[("instance", Kind::Int)], "instance 0 where none".to_owned());
        }
        if self.class.is_some() {
            let names: Vec<&str> = ClassId::ALL.iter().map(|class| class.name()).collect();
            let table = format!("semantic table {CLASS_TABLE_VERSION}: {}", names.join(" "));
            add(&[("semantic", Kind::UChar), ("score", Kind::Float)], table);
        }
        if self.color.is_some() {
            let fields = [("red", Kind::UChar), ("green", Kind::UChar), ("blue", Kind::UChar), ("camera", Kind::UChar)];
            add(&fields, format!("camera {UNSEEN} where none saw the point"));
        }
        header
    }

    #[inline]
    fn encode(&self, i: usize, row: &mut Row<'_>) {
        let point = &self.points[i];
        let sweep = self.placement.sweep(point);
        let lidar = sweep.lidar_position(point.offset_nanos);
        self.coordinates(self.placement.position(point).coords.into(), row);
        self.coordinates(lidar.into(), row);
        let cosine = match point.incidence {
            POINT_INCIDENCE_UNKNOWN => -1.0,
            incidence => f32::from(incidence) / 254.0,
        };
        row.f32(cosine).f64(sweep.time_s(point.offset_nanos)).i32(sweep.seq);
        row.u8(point.intensity).u8(point.ring);
        row.f32(f32::from(point.azimuth) / 100.0).f32(f32::from(point.elevation) / 100.0);
        row.u8(u8::from(point.flags & POINT_DYNAMIC != 0));
        if let Some(instance) = self.instance {
            row.i32(instance[i] as i32);
        }
        if let Some(class) = self.class {
            row.u8(class[i].class_id).f32(f32::from(class[i].score) / 255.0);
        }
        if let Some(color) = self.color {
            row.u8(color[i].r).u8(color[i].g).u8(color[i].b).u8(color[i].camera);
        }
    }

    // Where a row goes through a call, its place in memory is written and read again with every field.
    #[inline(always)]
    pub(crate) fn coordinates(&self, xyz: [f64; 3], row: &mut Row<'_>) {
        let [x, y, z] = xyz;
        match self.coordinates {
            Kind::Double => row.f64(x).f64(y).f64(z),
            _ => row.f32(x as f32).f32(y as f32).f32(z as f32),
        };
    }
}

fn column_rows<'a, T>(rows: &'a [T], topic: &str, submap: &Received<Submap>, n: usize) -> Result<&'a [T], StepError> {
    if rows.len() == n {
        return Ok(rows);
    }
    Err(StepError::data(format!("{topic} of submap {}: {} rows for {n} points", submap.seq(), rows.len())))
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
