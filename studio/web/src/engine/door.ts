// placeholder until names are known
export class Door { panic: string | undefined; constructor(_m: WebAssembly.Module, _a: (json: string, binary: Uint8Array | null) => void) {} request(_json: string, _binary: Uint8Array | null) {} }
