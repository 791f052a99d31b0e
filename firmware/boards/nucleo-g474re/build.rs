//! Passes `memory.x` and the start-up code's linker script to the linker, and declares the robot's module.

#[path = "../robot_module.rs"]
mod robot_module;

fn main() -> std::io::Result<()> {
    println!("cargo:rustc-link-search={}", env!("CARGO_MANIFEST_DIR"));
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    for file in ["memory.x", "build.rs", "../robot_module.rs"] {
        println!("cargo:rerun-if-changed={file}");
    }
    robot_module::declare()
}
