//! The robot as constants, and the linker script.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    rollwalk_board_build::prepare("../../../robots/agilebot.toml")
}
