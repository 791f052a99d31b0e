declare module "engine-worker-source" {
  const source: string;
  export default source;
}

declare module "robot-worker-source" {
  const source: string;
  export default source;
}
