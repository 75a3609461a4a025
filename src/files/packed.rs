//! Arrays and small tables as bytes, bit for bit. What is read back was written by this very build (see [`super::kept`]), so
//! that neither the order of bytes nor the layout of a type has to be that of other machines.

use bytemuck::{AnyBitPattern, NoUninit};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Puts arrays and tables one after another.
#[derive(Default)]
pub struct Packer(Vec<u8>);

impl Packer {
    /// Puts an array.
    pub fn put<T: NoUninit>(&mut self, array: &[T]) -> &mut Self {
        self.0.extend_from_slice(&(array.len() as u64).to_le_bytes());
        self.0.extend_from_slice(bytemuck::cast_slice(array));
        self
    }

    /// Puts a small table by its fields; `None` where it has no JSON that comes back equal, as of numbers that are not finite.
    pub fn put_table<T: Serialize + DeserializeOwned + PartialEq>(&mut self, table: &T) -> Option<&mut Self> {
        let json = serde_json::to_vec(table).ok()?;
        let back: T = serde_json::from_slice(&json).ok()?;
        (back == *table).then(|| self.put(&json))
    }

    /// All of it.
    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

/// Takes them in the same order.
pub struct Unpacker<'a>(&'a [u8]);

impl<'a> Unpacker<'a> {
    /// Of what [`Packer::finish`] gave.
    pub fn new(bytes: &'a [u8]) -> Self {
        Unpacker(bytes)
    }

    /// The next array; `None` where it is cut.
    pub fn take<T: AnyBitPattern + NoUninit>(&mut self) -> Option<Vec<T>> {
        let count = u64::from_le_bytes(self.0.split_off(..8)?.try_into().ok()?);
        let bytes = self.0.split_off(..usize::try_from(count).ok()?.checked_mul(size_of::<T>())?)?;
        let mut array = vec![T::zeroed(); bytes.len() / size_of::<T>()];
        bytemuck::cast_slice_mut(&mut array).copy_from_slice(bytes);
        Some(array)
    }

    /// The next table; `None` where it is cut or has other fields.
    pub fn take_table<T: DeserializeOwned>(&mut self) -> Option<T> {
        serde_json::from_slice(&self.take::<u8>()?).ok()
    }

    /// `None` where something is left: what is too long is of another layout.
    pub fn end(self) -> Option<()> {
        self.0.is_empty().then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_and_tables_come_back_bit_for_bit_and_a_cut_one_does_not() {
        let numbers = [0.1f32, -0.0, f32::NAN, 1e-40];
        let mut packer = Packer::default();
        packer.put(&numbers).put(&[[1u32, 2, 3]]);
        packer.put_table(&(0.1f64, Some("word".to_string()))).unwrap();
        let bytes = packer.finish();
        let mut unpacker = Unpacker::new(&bytes);
        let back: Vec<f32> = unpacker.take().unwrap();
        assert_eq!(back.iter().map(|own| own.to_bits()).collect::<Vec<_>>(), numbers.map(f32::to_bits));
        assert_eq!(unpacker.take::<[u32; 3]>(), Some(vec![[1, 2, 3]]));
        assert_eq!(unpacker.take_table::<(f64, Option<String>)>(), Some((0.1, Some("word".to_string()))));
        assert!(unpacker.end().is_some());
        for length in 0..bytes.len() {
            let mut cut = Unpacker::new(&bytes[..length]);
            let whole = (|| {
                cut.take::<f32>()?;
                cut.take::<[u32; 3]>()?;
                cut.take_table::<(f64, Option<String>)>()
            })();
            assert_eq!(whole, None, "{length} bytes");
        }
        assert!(Packer::default().put_table(&Some(f64::NAN)).is_none(), "read back as nothing");
    }
}
