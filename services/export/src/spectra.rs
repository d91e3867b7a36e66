//! The cloud of spectra: the points of a submap that a mosaic camera saw.

use crate::cloud::Cloud;
use crate::folder::Folder;
use crate::index::SpectraEntry;
use crate::place::{self, Place, odometry_frame};
use formats::ply::{Header, Kind, Property};
use messages::{NO_SPECTRUM, Spectra, SpectraHeader, SpectraView};
use stage::{Received, StepError};

/// Writes the points with a spectrum: position, index in the submap's cloud, reflectance by band. A band that was not
/// measured is NaN: no reflectance that anybody could average by mistake.
pub(crate) fn write(
    cloud: &Cloud<'_>,
    column: &Received<Spectra>,
    folder: &Folder,
    place: Option<&Place<'_>>,
) -> Result<SpectraEntry, StepError> {
    let seq = cloud.seq;
    let head = column.header();
    let n = cloud.points.len();
    let view = SpectraView::new(head, column.rows()).filter(|_| head.n_points as usize == n).ok_or_else(|| {
        StepError::data(format!(
            "spectra of submap {seq}: {} words do not make {} indices and {} spectra of {} bands for {n} points",
            column.rows().len(),
            head.n_points,
            head.n_spectra,
            head.n_bands
        ))
    })?;
    let seen = seen_points(&column.rows()[..n], head.n_spectra, seq)?;
    let wavelengths_nm = head.wavelengths_nm[..head.n_bands as usize].to_vec();
    let file = format!("clouds/submap_{seq:04}_spectra.ply");
    let header = header(cloud, head, &wavelengths_nm);
    let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
        let point_idx = seen[i];
        cloud.coordinates(cloud.placement.position(&cloud.points[point_idx as usize]).coords.into(), row);
        row.i32(point_idx as i32);
        if let Some((valid, reflectances)) = view.spectrum(point_idx as usize) {
            for (band, reflectance) in reflectances.iter().enumerate() {
                row.f32(if valid >> band & 1 == 1 { *reflectance } else { f32::NAN });
            }
        }
    };
    let (bytes, _) = place::write(&folder.path(&file), header, seen.len(), encode, place)?;
    Ok(SpectraEntry { file, bytes, n_spectra: seen.len() as u64, wavelengths_nm })
}

/// Points with a spectrum, in order.
fn seen_points(indices: &[u32], n_spectra: u32, seq: u64) -> Result<Vec<u32>, StepError> {
    if i32::try_from(indices.len()).is_err() {
        return Err(StepError::data(format!("submap {seq}: {} points do not fit an int", indices.len())));
    }
    let outside = |index: &u32| *index != NO_SPECTRUM && *index >= n_spectra;
    if let Some(point) = indices.iter().position(outside) {
        let index = indices[point];
        return Err(StepError::data(format!(
            "spectra of submap {seq}: point {point} refers to spectrum {index} of {n_spectra}"
        )));
    }
    let seen = (0..).zip(indices).filter(|(_, index)| **index != NO_SPECTRUM);
    Ok(seen.map(|(point, _)| point).collect())
}

fn header(cloud: &Cloud<'_>, head: &SpectraHeader, wavelengths_nm: &[f32]) -> Header {
    let place =
        [("x", cloud.coordinates), ("y", cloud.coordinates), ("z", cloud.coordinates), ("point_idx", Kind::Int)];
    let mut header = Header::new(place)
        .comment(format!("REPLICA spectra of submap {}", cloud.seq))
        .info(odometry_frame())
        .info(format!("point_idx row of submap_{:04}.ply, counted from 0", cloud.seq))
        .info("bands reflectance, nan where not measured");
    for (band, wavelength_nm) in wavelengths_nm.iter().enumerate() {
        header.infos.push(format!("band {band} camera {} center {wavelength_nm} nm", head.cameras[band]));
        let name = format!("band_{wavelength_nm:04.0}nm");
        // Two cameras may have bands within the same nanometre.
        let is_taken = header.properties.iter().any(|property| property.name == name);
        let name = if is_taken { format!("{name}_b{band:02}") } else { name };
        header.properties.push(Property::new(name, Kind::Float));
    }
    header
}
