//! A recording as an MCAP file with Foxglove's messages.

use crate::scene::Scene;
use anyhow::{Context as _, bail};
use foxglove::{Context, McapWriter};
use recording::RecordingReader;
use std::path::Path;

/// Converts a recording. A cut recording is converted up to the cut, which the error reports.
pub fn convert(recording: &Path, out: &Path, points: usize) -> anyhow::Result<()> {
    let mut reader = RecordingReader::open(recording)?;
    let context = Context::new();
    let writer = McapWriter::new().context(&context).create_new_buffered_file(out);
    let writer = writer.with_context(|| out.display().to_string())?;
    let mut scene = Scene::new(&context, points);
    let result = show_all(&mut reader, &mut scene);
    scene.finish();
    writer.close().with_context(|| out.display().to_string())?;
    result?;
    let n = scene.n_shown();
    if n == 0 {
        bail!(
            "{}: contains none of the topics {}; {} is empty",
            recording.display(),
            Scene::TOPICS.join(", "),
            out.display()
        );
    }
    println!("{}: {n} messages", out.display());
    Ok(())
}

fn show_all(reader: &mut RecordingReader, scene: &mut Scene) -> anyhow::Result<()> {
    scene.expect_columns(reader.topics().iter().map(|topic| topic.name.as_str()));
    while let Some(message) = reader.next()? {
        if message.topic.ticks_of().is_none() {
            scene.show(&message.topic.table, &message.envelope, message.header(), message.rows())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
