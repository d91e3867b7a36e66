//! The cloud of a submap: the fields of Paris-CARLA-3D, then additional fields.

use crate::error::DeliveryError;
use crate::frame::odometry_line;
use crate::submap_geometry::SubmapGeometry;
use formats::ply::{Header, Kind, Row};
use messages::{
    CLASS_TABLE_VERSION, ClassId, ClassRow, ColorRow, MATERIAL_TABLE_VERSION, MaterialId, MaterialRow, POINT_DYNAMIC,
    POINT_INCIDENCE_UNKNOWN, SpectraHeader, SubmapHeader, SubmapPoint, UNSEEN,
};

/// A submap and its columns, as received. Columns of points have a row for each point.
#[derive(Clone, Copy)]
pub struct ReceivedSubmap<'a> {
    /// Number of the submap.
    pub seq: u64,
    /// Header of the submap.
    pub header: &'a SubmapHeader,
    /// Points of the submap.
    pub points: &'a [SubmapPoint],
    /// Colors, if there is such a column.
    pub color: Option<&'a [ColorRow]>,
    /// Classes, if there is such a column.
    pub class: Option<&'a [ClassRow]>,
    /// Instances, if there is such a column.
    pub instance: Option<&'a [u32]>,
    /// Materials, if there is such a column.
    pub material: Option<&'a [MaterialRow]>,
    /// Regions, if there is such a column.
    pub region: Option<&'a [u32]>,
    /// Topics of further segmenters with their classes.
    pub further_classes: &'a [(&'a str, &'a [ClassRow])],
    /// Header and words of the spectra, if there is such a column.
    pub spectra: Option<(&'a SpectraHeader, &'a [u32])>,
    /// Topics of the columns that were lost.
    pub lost: &'a [&'static str],
}

/// What the points of a cloud have beside position, time, angles and intensity.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "a flag for each column")]
pub struct CloudFields<'a> {
    /// Type of coordinates.
    pub coordinates: Kind,
    /// Whether the points are those of several LiDARs.
    pub has_lidars: bool,
    /// Whether there are instances.
    pub has_instance: bool,
    /// Whether there are classes.
    pub has_class: bool,
    /// Whether there are colors.
    pub has_color: bool,
    /// Whether there are materials.
    pub has_material: bool,
    /// Whether there are regions.
    pub has_region: bool,
    /// Topics of further segmenters.
    pub further_classes: &'a [&'a str],
}

impl CloudFields<'_> {
    /// Those of a run with all stages and their defaults.
    pub const ALL: Self = Self {
        coordinates: Kind::Float,
        has_lidars: false,
        has_instance: true,
        has_class: true,
        has_color: true,
        has_material: false,
        has_region: false,
        further_classes: &[],
    };
}

/// The header of a cloud.
pub(crate) fn header_of(fields: CloudFields<'_>) -> Header {
    let mut header = Header::new([
        ("x", fields.coordinates),
        ("y", fields.coordinates),
        ("z", fields.coordinates),
        ("x_lidar_position", fields.coordinates),
        ("y_lidar_position", fields.coordinates),
        ("z_lidar_position", fields.coordinates),
        ("cos_angle_lidar_surface", Kind::Float),
        ("timestamp", Kind::Double),
        ("index_frame", Kind::Int),
        ("intensity", Kind::UChar),
        ("ring", Kind::UChar),
        ("azimuth_deg", Kind::Float),
        ("elevation_deg", Kind::Float),
        ("dynamic", Kind::UChar),
    ])
    .info(odometry_line())
    .info("timestamp s since 1970-01-01T00:00:00Z")
    .info("cos_angle_lidar_surface -1 where unknown");
    let mut add = |more: &[(&str, Kind)], info: String| {
        header.properties.extend(Header::new(more.iter().copied()).properties);
        header.infos.push(info);
    };
    if fields.has_lidars {
        add(&[("lidar", Kind::UChar)], "lidar index in drive.toml".to_owned());
    }
    if fields.has_instance {
        add(&[("instance", Kind::Int)], "instance 0 where none".to_owned());
    }
    if fields.has_class {
        let names: Vec<&str> = ClassId::ALL.iter().map(|class| class.name()).collect();
        let table = format!("semantic table {CLASS_TABLE_VERSION}: {}", names.join(" "));
        add(&[("semantic", Kind::UChar), ("score", Kind::Float)], table);
    }
    if fields.has_color {
        let colors = [("red", Kind::UChar), ("green", Kind::UChar), ("blue", Kind::UChar), ("camera", Kind::UChar)];
        add(&colors, format!("camera {UNSEEN} where none saw the point"));
    }
    if fields.has_material {
        let names: Vec<&str> = MaterialId::ALL.iter().map(|material| material.name()).collect();
        let table = format!("material table {MATERIAL_TABLE_VERSION}: {}", names.join(" "));
        add(&[("material", Kind::UChar), ("material_score", Kind::Float)], table);
    }
    if fields.has_region {
        add(&[("region", Kind::Int)], "region 0 where none".to_owned());
    }
    for topic in fields.further_classes {
        let score = format!("{topic}_score");
        add(&[(*topic, Kind::UChar), (&score, Kind::Float)], format!("{topic} of the table of semantic"));
    }
    header
}

/// A checked submap with its columns, as slices of equal length.
pub(crate) struct SubmapColumns<'a> {
    pub(crate) seq: u64,
    pub(crate) points: &'a [SubmapPoint],
    pub(crate) geometry: SubmapGeometry,
    pub(crate) color: Option<&'a [ColorRow]>,
    pub(crate) class: Option<&'a [ClassRow]>,
    pub(crate) instance: Option<&'a [u32]>,
    pub(crate) material: Option<&'a [MaterialRow]>,
    pub(crate) region: Option<&'a [u32]>,
    /// Topics of further segmenters with their classes.
    further_classes: &'a [(&'a str, &'a [ClassRow])],
    /// Type of coordinates in files.
    pub(crate) coordinates: Kind,
    /// Whether the points are those of several LiDARs.
    has_lidars: bool,
}

impl<'a> SubmapColumns<'a> {
    /// Checks the submap, its instances and its regions.
    pub(crate) fn new(received: &ReceivedSubmap<'a>, coordinates: Kind) -> Result<Self, DeliveryError> {
        let ReceivedSubmap { seq, header, points, color, class, instance, material, region, further_classes, .. } =
            *received;
        let geometry = SubmapGeometry::new(seq, header, points)?;
        for (name, ids) in [("instance", instance), ("region", region)] {
            let largest = ids.and_then(|ids| ids.iter().copied().max());
            if let Some(id) = largest.filter(|id| i32::try_from(*id).is_err()) {
                return Err(DeliveryError::ExceedsInt { what: format!("{name} of submap {seq}: id {id}") });
            }
        }
        let has_lidars = header.n_lidars > 1;
        Ok(Self {
            seq,
            points,
            geometry,
            color,
            class,
            instance,
            material,
            region,
            further_classes,
            coordinates,
            has_lidars,
        })
    }

    pub(crate) fn header(&self) -> Header {
        let further: Vec<&str> = self.further_classes.iter().map(|(topic, _)| *topic).collect();
        let fields = CloudFields {
            coordinates: self.coordinates,
            has_lidars: self.has_lidars,
            has_instance: self.instance.is_some(),
            has_class: self.class.is_some(),
            has_color: self.color.is_some(),
            has_material: self.material.is_some(),
            has_region: self.region.is_some(),
            further_classes: &further,
        };
        header_of(fields).comment(format!("REPLICA submap {}", self.seq))
    }

    #[inline]
    pub(crate) fn encode(&self, i: usize, row: &mut Row<'_>) {
        let point = &self.points[i];
        let sweep = self.geometry.sweep(point);
        let lidar = sweep.lidar_position(point.offset_nanos);
        self.coordinates(self.geometry.position(point).coords.into(), row);
        self.coordinates(lidar.into(), row);
        let cosine = match point.incidence {
            POINT_INCIDENCE_UNKNOWN => -1.0,
            incidence => f32::from(incidence) / 254.0,
        };
        row.f32(cosine).f64(sweep.time_s(point.offset_nanos)).i32(sweep.seq);
        row.u8(point.intensity).u8(point.ring);
        row.f32(f32::from(point.azimuth) / 100.0).f32(f32::from(point.elevation) / 100.0);
        row.u8(u8::from(point.flags & POINT_DYNAMIC != 0));
        if self.has_lidars {
            row.u8(sweep.lidar);
        }
        if let Some(instance) = self.instance {
            row.i32(instance[i] as i32);
        }
        if let Some(class) = self.class {
            row.u8(class[i].class_id).f32(f32::from(class[i].score) / 255.0);
        }
        if let Some(color) = self.color {
            row.u8(color[i].r).u8(color[i].g).u8(color[i].b).u8(color[i].camera);
        }
        if let Some(material) = self.material {
            row.u8(material[i].material_id).f32(f32::from(material[i].score) / 255.0);
        }
        if let Some(region) = self.region {
            row.i32(region[i] as i32);
        }
        for (_, classes) in self.further_classes {
            row.u8(classes[i].class_id).f32(f32::from(classes[i].score) / 255.0);
        }
    }

    // Always inlined: otherwise the row is stored and loaded again for every field.
    #[inline(always)]
    pub(crate) fn coordinates(&self, xyz: [f64; 3], row: &mut Row<'_>) {
        let [x, y, z] = xyz;
        match self.coordinates {
            Kind::Double => row.f64(x).f64(y).f64(z),
            _ => row.f32(x as f32).f32(y as f32).f32(z as f32),
        };
    }
}
