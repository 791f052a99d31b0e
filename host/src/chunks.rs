//! Decoder of zstd, the compression of MCAP chunks by other tools.

use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{McapError, McapResult};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::fmt;
use std::io::Read;

/// Maximum length of the frame header, a block and the checksum, bytes (RFC 8878).
const INPUT_MAX: usize = 18 + 3 + 128 * 1024 + 4;

/// Streaming decoder of zstd. Each call decodes at most one block, so that a small chunk cannot fill the memory.
#[derive(Default)]
pub(crate) struct Zstd(FrameDecoder);

impl Decompressor for Zstd {
    fn next_read_size(&self) -> usize {
        if self.0.can_collect() > 0 { 0 } else { INPUT_MAX }
    }

    fn decompress(&mut self, src: &[u8], dst: &mut [u8]) -> McapResult<DecompressResult> {
        let failed = |error: &dyn fmt::Display| McapError::DecompressionError(error.to_string());
        let mut rest = src;
        if self.0.can_collect() == 0 {
            if self.0.is_finished() {
                self.0.reset(&mut rest).map_err(|error| failed(&error))?;
            }
            let block = self.0.decode_blocks(&mut rest, BlockDecodingStrategy::UptoBlocks(1));
            block.map_err(|error| failed(&error))?;
        }
        let wrote = self.0.read(dst).map_err(|error| failed(&error))?;
        Ok(DecompressResult { consumed: src.len() - rest.len(), wrote })
    }

    fn reset(&mut self) -> McapResult<()> {
        self.0 = FrameDecoder::new();
        Ok(())
    }

    fn name(&self) -> &'static str {
        "zstd"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::io::MessageReader;
    use mcap::records::MessageHeader;
    use mcap::{Compression, WriteOptions};
    use std::collections::BTreeMap;
    use std::io::Cursor;

    /// Tests two chunks of many blocks. Repetitive bytes alternate with pseudorandom bytes.
    #[test]
    fn chunks_of_many_blocks_are_unpacked() {
        let noise = |k: u32| (k.wrapping_mul(k).wrapping_mul(2_654_435_761) >> 24) as u8;
        let byte = |k: u32| if k >> 15 & 1 == 0 { (k % 7) as u8 } else { noise(k) };
        let messages = [0, 1].map(|part| (part..part + 1_000_000).map(byte).collect::<Vec<u8>>());
        let mut file = Cursor::new(Vec::new());
        let options = WriteOptions::new().compression(Some(Compression::Zstd));
        let mut writer = options.chunk_size(Some(900_000)).create(&mut file).unwrap();
        let channel = writer.add_channel(0, "bytes", "", &BTreeMap::new()).unwrap();
        for data in &messages {
            let header =
                MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
            writer.write_to_known_channel(&header, data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let mut reader = MessageReader::new(&file.get_ref()[..]);
        reader.add_decompressor(Zstd::default()).unwrap();
        let read: Vec<Vec<u8>> = reader.map(|message| message.unwrap().data.into_owned()).collect();
        assert!(read == messages);
    }
}
