//! A CAN frame as a value: what every bus, simulated or real, carries.

/// A classic CAN 2.0A data frame with an 11-bit identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFrame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A frame, or `None` when `id` needs more than 11 bits or `data` is longer than 8 bytes.
    pub fn new(id: u16, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        (id < 0x800).then_some(Self { id, len: data.len() as u8, data: bytes })
    }

    /// The 11-bit identifier; lower is more urgent.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// The payload, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }
}
