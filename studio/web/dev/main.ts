// The page on a mock engine, for work on its looks without the real one. Never built into dist.
import { start } from "../src/start.ts";
import { MockEngine } from "./mock.ts";

void MockEngine.load().then((engine) => start(document.getElementById("studio")!, engine));
