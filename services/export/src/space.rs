//! Checks whether the clouds of a recorded drive fit the disk, before a run of hours.

use crate::Settings;
use crate::columns::JoinedColumns;
use delivery::space_need;
use drive::Drive;
use stage::space::{bytes_of_files, free_bytes, size_text};
use stage::{Context, Mode, Problem};

/// Share of the estimated space below which a start is refused: the estimate may be too high, and space may be freed
/// during the run.
const MIN_SHARE: f64 = 0.6;

/// The problem if the clouds will not fit. A drive that cannot be read is reported by its source.
pub(crate) fn lacks(settings: &Settings, context: &Context, columns: &JoinedColumns) -> Option<Problem> {
    if context.mode == Mode::Live || settings.formats.is_empty() {
        return None;
    }
    let need = space_need(&Drive::open(&context.drive).ok()?, &columns.fields(settings), columns.has_spectra()).ok()?;
    // Existing clouds are continued or replaced.
    let free = free_bytes(&context.output)? + bytes_of_files(&context.output.join("clouds"));
    let is_too_small = (free as f64) < MIN_SHARE * need.bytes as f64;
    let text = || {
        format!(
            "{}: {} free, but the clouds of about {:.1} million points need about {}; make room, or set another run.output",
            context.output.display(),
            size_text(free),
            need.points as f64 * 1e-6,
            size_text(need.bytes)
        )
    };
    is_too_small.then(|| Problem::for_key("", text()))
}
