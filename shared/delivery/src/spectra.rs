//! The cloud of spectra: the points of a submap that a mosaic camera recorded.

use crate::error::DeliveryError;
use crate::folder::Folder;
use crate::frame::odometry_line;
use crate::index::SpectraEntry;
use crate::place::{self, Place};
use crate::submap_cloud::SubmapColumns;
use formats::ply::{Header, Kind, Property};
use messages::{NO_SPECTRUM, SpectraHeader, SpectraView};

/// Writes the points with a spectrum: position, index in the cloud of the submap, reflectance of each band. Bands that
/// were not measured are NaN, which prevents averaging them by mistake.
pub(crate) fn write(
    columns: &SubmapColumns<'_>,
    head: &SpectraHeader,
    words: &[u32],
    folder: &Folder,
    place: Option<&Place<'_>>,
) -> Result<SpectraEntry, DeliveryError> {
    let seq = columns.seq;
    let n = columns.points.len();
    let view =
        SpectraView::new(head, words).filter(|_| head.n_points as usize == n).ok_or(DeliveryError::SpectraSize {
            seq,
            n_words: words.len(),
            n_indices: head.n_points,
            n_spectra: head.n_spectra,
            n_bands: head.n_bands,
            n_points: n,
        })?;
    let seen = seen_points(&words[..n], head.n_spectra, seq)?;
    let wavelengths_nm = head.wavelengths_nm[..head.n_bands as usize].to_vec();
    let file = format!("clouds/submap_{seq:04}_spectra.ply");
    let header = header(columns, head, &wavelengths_nm);
    let encode = |i: usize, row: &mut formats::ply::Row<'_>| {
        let point_idx = seen[i];
        columns.coordinates(columns.geometry.position(&columns.points[point_idx as usize]).coords.into(), row);
        row.i32(point_idx as i32);
        if let Some((valid, reflectances)) = view.spectrum(point_idx as usize) {
            for (band, reflectance) in reflectances.iter().enumerate() {
                row.f32(if valid >> band & 1 == 1 { *reflectance } else { f32::NAN });
            }
        }
    };
    let bytes = place::write_cloud(&folder.path(&file), header, seen.len(), encode, place)?.bytes;
    Ok(SpectraEntry { file, bytes, n_spectra: seen.len() as u64, wavelengths_nm })
}

/// Indices of the points with a spectrum, ascending.
fn seen_points(indices: &[u32], n_spectra: u32, seq: u64) -> Result<Vec<u32>, DeliveryError> {
    if i32::try_from(indices.len()).is_err() {
        return Err(DeliveryError::ExceedsInt { what: format!("submap {seq}: number of points {}", indices.len()) });
    }
    let outside = |index: &u32| *index != NO_SPECTRUM && *index >= n_spectra;
    if let Some(point) = indices.iter().position(outside) {
        return Err(DeliveryError::SpectrumIndex { seq, point, index: indices[point], n_spectra });
    }
    let seen = (0..).zip(indices).filter(|(_, index)| **index != NO_SPECTRUM);
    Ok(seen.map(|(point, _)| point).collect())
}

fn header(columns: &SubmapColumns<'_>, head: &SpectraHeader, wavelengths_nm: &[f32]) -> Header {
    let kind = columns.coordinates;
    let mut header = Header::new([("x", kind), ("y", kind), ("z", kind), ("point_idx", Kind::Int)])
        .comment(format!("REPLICA spectra of submap {}", columns.seq))
        .info(odometry_line())
        .info(format!("point_idx row of submap_{:04}.ply, counted from 0", columns.seq))
        .info("bands reflectance, nan where not measured");
    for (band, wavelength_nm) in wavelengths_nm.iter().enumerate() {
        header.infos.push(format!("band {band} camera {} center {wavelength_nm} nm", head.cameras[band]));
        let name = format!("band_{wavelength_nm:04.0}nm");
        // Bands of two cameras may round to the same nanometre.
        let is_taken = header.properties.iter().any(|property| property.name == name);
        let name = if is_taken { format!("{name}_b{band:02}") } else { name };
        header.properties.push(Property::new(name, Kind::Float));
    }
    header
}
