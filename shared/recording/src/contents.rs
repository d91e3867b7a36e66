//! The schemas, channels and messages of a recording, record by record.

use super::error::{RecordFault, mcap_fault};
use super::topic::RecordedTopic;
use super::{ABOUT, ENCODING, table, texts};
use mcap::records::{Channel, Record, op};
use messages::pod::rows_from_bytes;
use messages::{ByteTable, Envelope};
use std::collections::BTreeMap;

/// Content read so far.
#[derive(Default)]
pub(super) struct Contents {
    schemas: BTreeMap<u16, Result<ByteTable, RecordFault>>,
    /// Index into `topics`; `None` for channels of other programs.
    channels: BTreeMap<u16, Option<usize>>,
    pub topics: Vec<RecordedTopic>,
    pub about: BTreeMap<String, String>,
    /// Bytes of the last message.
    pub data: Vec<u8>,
}

impl Contents {
    /// Adds a record. Returns the index of the topic if it is a message of a known topic, which is then in `data`.
    pub fn add(&mut self, opcode: u8, body: &[u8]) -> Result<Option<usize>, RecordFault> {
        if ![op::SCHEMA, op::CHANNEL, op::METADATA, op::MESSAGE].contains(&opcode) {
            return Ok(None);
        }
        texts::check(opcode, body)?;
        match mcap::parse_record(opcode, body).map_err(|error| mcap_fault(&error))? {
            Record::Schema { header, data } if header.encoding == ENCODING => {
                self.schemas.insert(header.id, parse_table(&data));
            }
            // The summary section repeats channels.
            Record::Channel(channel) if !self.channels.contains_key(&channel.id) => {
                let id = channel.id;
                let topic = topic_of(channel, &self.schemas)?;
                let twin = topic.as_ref().and_then(|topic| self.topics.iter().find(|other| other.name == topic.name));
                if let Some(twin) = twin {
                    return Err(RecordFault::DuplicateTopic(twin.name.clone()));
                }
                self.channels.insert(id, topic.as_ref().map(|_| self.topics.len()));
                self.topics.extend(topic);
            }
            Record::Metadata(metadata) if metadata.name == ABOUT => self.about = metadata.metadata,
            Record::Message { header, data } => {
                let id = header.channel_id;
                let Some(index) = *self.channels.get(&id).ok_or(RecordFault::UndeclaredChannel(id))? else {
                    return Ok(None);
                };
                self.data.clear();
                self.data.extend_from_slice(&data);
                check_length(&self.topics[index], &data)?;
                return Ok(Some(index));
            }
            _ => {}
        }
        Ok(None)
    }
}

fn parse_table(data: &[u8]) -> Result<ByteTable, RecordFault> {
    let parsed: ByteTable = serde_json::from_slice(data).map_err(|error| RecordFault::Schema(error.to_string()))?;
    table::check(&parsed).map(|()| parsed.with_current_names())
}

/// Index of the topic of a channel; `None` for channels of other programs.
fn topic_of(
    channel: Channel,
    schemas: &BTreeMap<u16, Result<ByteTable, RecordFault>>,
) -> Result<Option<RecordedTopic>, RecordFault> {
    if channel.message_encoding != ENCODING {
        return Ok(None);
    }
    match schemas.get(&channel.schema_id) {
        Some(table) => Ok(Some(RecordedTopic { name: channel.topic, table: table.clone()? })),
        None => Err(RecordFault::NoSchema(channel.topic)),
    }
}

fn check_length(topic: &RecordedTopic, bytes: &[u8]) -> Result<(), RecordFault> {
    let table = &topic.table;
    let n_bytes = bytes.len();
    let Some(envelope) = envelope_of(bytes) else {
        return Err(RecordFault::NoEnvelope { topic: topic.name.clone(), n_bytes });
    };
    let rows = (envelope.len as usize).checked_mul(table.row_bytes);
    let expected = rows.and_then(|rows| rows.checked_add(size_of::<Envelope>() + table.header_bytes));
    if expected == Some(n_bytes) && envelope.len as usize <= table.max_rows {
        return Ok(());
    }
    let seq = envelope.seq;
    let n_rows = envelope.len;
    let &ByteTable { header_bytes, row_bytes, max_rows, .. } = table;
    let topic = topic.name.clone();
    Err(RecordFault::MessageSize { topic, seq, n_bytes, header_bytes, n_rows, row_bytes, max_rows })
}

/// The envelope at the start of a message.
pub(super) fn envelope_of(bytes: &[u8]) -> Option<Envelope> {
    rows_from_bytes::<Envelope>(bytes.get(..size_of::<Envelope>())?)?.first().copied()
}
